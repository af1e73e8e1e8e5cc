#pragma once

#include <memory>
#include <mutex>

#include "mr/core/parallel.h"
#include "mr/synth/people.h"
#include "mr/synth/room.h"

namespace mr::synth {

/// A rig's room, its people and what its events move, made when they are first needed. Thread-safe.
class SyntheticScene {
 public:
  SyntheticScene(const RigConfig& rig, double fps);

  /// Makes room and people now, with the threads of the caller's arena. Before the scene is shared.
  void build();

  std::shared_ptr<const Room> room();
  /// Everybody at a time, and what events move; null where there is nobody and nothing.
  std::shared_ptr<const PosedPeople> people(double time_s);

 private:
  void make();

  const RigConfig rig_;
  const double fps_, period_s_;
  // What is made under the lock runs in an arena of its own: a thread that waits for its share of
  // the work must not begin another task that wants the lock.
  Arena alone_{1};
  std::mutex mutex_;
  std::shared_ptr<const Room> room_;
  std::unique_ptr<People> people_;
};

}  // namespace mr::synth
