#pragma once

#include <vector>

#include "mr/calib/motion.h"
#include "mr/calib/normal_equations.h"

namespace mr::calib {

/// One Gauss-Newton step over the pose graph: nodes are the parts, edges the normal equations of
/// overlapping pairs. Solves for all motions at once by conjugate gradients. `corrections`: the
/// present motion of each part; a weak prior draws it towards zero, which also fixes the gauge
/// freedom of a common motion of all parts.
Motions solve_pose_graph(const std::vector<NormalEquations>& edges, const Motions& corrections);

}  // namespace mr::calib
