#pragma once

#include <vector>

#include "mr/calib/motion.h"
#include "mr/calib/normal_equations.h"

namespace mr::calib {

/// One step of Gauss and Newton over the pose graph, whose nodes are the parts and whose edges are
/// the normal equations of the pairs that overlap: the motions that bring the linked parts
/// together, by conjugate gradients. `corrections`: how far each part was moved already, towards
/// none of which it is drawn a little (a prior). As nothing but that sees a common motion of all,
/// their mean stays where it is.
Motions solve_pose_graph(const std::vector<NormalEquations>& edges, const Motions& corrections);

}  // namespace mr::calib
