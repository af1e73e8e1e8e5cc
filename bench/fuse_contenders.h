#pragma once

#include <string>
#include <vector>

#include "fuse_case.h"
#include "race.h"

namespace mr::bench {

/// Contenders of fusion: one depth frame to an indexed mesh. The case must outlive them.

/// "ours" bridges depth edges as the peer does, for a fair comparison; "ours/cut" cuts them;
/// "ours/planes" does so with a plane per pixel, as the pipeline does.
std::vector<Contender> fuse_ours(const FuseCase& input, int threads);

/// The contender that fuse_ours() calls "ours", in the stage `scan`.
inline const std::string kFuseRoom = "fuse-room";

/// "ours": the scan as the pipeline fuses it; kFuseRoom: `fuse`'s "ours" on the room; and
/// "fuse-room/planes", `fuse`'s "ours/planes". Both cases must outlive them.
std::vector<Contender> scan_contenders(const FuseCase& scan, const FuseCase& room, int threads);

/// Whether this was built with Open3D.
bool has_open3d();

/// Open3D's VoxelBlockGrid with its best parameters: for block sizes of 8 and 16, the block
/// capacity that a trial found fastest. Empty: built without Open3D.
std::vector<Contender> fuse_open3d(const FuseCase& input, int threads);

}  // namespace mr::bench
