#pragma once

#include <vector>

#include "fuse_case.h"
#include "race.h"

namespace mr::bench {

/// Depth to indexed mesh in one run. The case must outlive them.

/// "ours", which bridges depth edges as the peer does, so that like is compared with like, and
/// "ours/cut", which is what the pipeline runs.
std::vector<Contender> fuse_ours(const FuseCase& input, int threads);

/// Whether Open3D was there when this was built.
bool has_open3d();

/// Open3D's VoxelBlockGrid as it is at its best: per block size of 8 and 16 the room for blocks
/// that a trial found fastest. Empty where there is no Open3D.
std::vector<Contender> fuse_open3d(const FuseCase& input, int threads);

}  // namespace mr::bench
