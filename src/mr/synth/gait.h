#pragma once

#include "mr/synth/person.h"
#include "mr/synth/skeleton.h"
#include "mr/synth/stance.h"

namespace mr::synth {

/// A path on which someone walks; floor frame.
class WalkPath {
 public:
  virtual ~WalkPath() = default;
  virtual double length_m() const = 0;
  /// The pose at a fraction of the length. A closed path is periodic; others clamp to their ends.
  virtual FloorPose at(double part) const = 0;
};

/// The posture at a time of a walk: for every bone the pose rest → world.
Posture posture_at(const Skeleton& skeleton, const Walk& walk, double time_s);

/// The stance of a walking person at a fraction of a path, arms swinging.
Stance walking_stance(const Skeleton& skeleton, const WalkPath& way, double part,
                      std::uint64_t seed);

/// Whether the sole of a foot (0 left, 1 right) is flat on the floor at that time.
bool foot_is_flat(const Walk& walk, int side, double time_s);

}  // namespace mr::synth
