#pragma once

#include "mr/synth/person.h"
#include "mr/synth/skeleton.h"

namespace mr::synth {

/// Where every bone is at a time of a walk: rest → world.
Posture posture_at(const Skeleton& skeleton, const Walk& walk, double time_s);

/// Is the sole of a foot (0 left, 1 right) flat on the floor then?
bool foot_is_flat(const Walk& walk, int side, double time_s);

}  // namespace mr::synth
