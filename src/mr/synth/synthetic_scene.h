#pragma once

#include <memory>
#include <mutex>

#include "mr/core/parallel.h"
#include "mr/synth/people.h"
#include "mr/synth/room.h"

namespace mr::synth {

/// A rig's room, people and props, created lazily. Thread-safe.
class SyntheticScene {
 public:
  SyntheticScene(const RigConfig& rig, double fps);

  /// Creates room and people now, with the threads of the caller's arena. To be called before the
  /// scene is shared between threads.
  void build();

  std::shared_ptr<const Room> room();
  /// The posed people and props at a time; null if there are none.
  std::shared_ptr<const PosedPeople> people(double time_s);

 private:
  void make();

  const RigConfig rig_;
  const double fps_, period_s_;
  // Work under the lock runs in an arena of its own, so that a thread waiting for it does not steal
  // another task that wants the lock (deadlock).
  Arena alone_{1};
  std::mutex mutex_;
  std::shared_ptr<const Room> room_;
  std::unique_ptr<People> people_;
};

}  // namespace mr::synth
