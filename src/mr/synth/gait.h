#pragma once

#include "mr/synth/person.h"
#include "mr/synth/skeleton.h"
#include "mr/synth/stance.h"

namespace mr::synth {

/// Where someone walks; floor frame.
class WalkPath {
 public:
  virtual ~WalkPath() = default;
  virtual double length_m() const = 0;
  /// `part` of the way's length, any number: a way that is closed goes round and round, others end.
  virtual FloorPose at(double part) const = 0;
};

/// Where every bone is at a time of a walk: rest → world.
Posture posture_at(const Skeleton& skeleton, const Walk& walk, double time_s);

/// How someone walks who is at a part of a way, arms swinging.
Stance walking_stance(const Skeleton& skeleton, const WalkPath& way, double part,
                      std::uint64_t seed);

/// Is the sole of a foot (0 left, 1 right) flat on the floor then?
bool foot_is_flat(const Walk& walk, int side, double time_s);

}  // namespace mr::synth
