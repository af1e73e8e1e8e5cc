#include "fuse_contenders.h"

namespace mr::bench {

bool has_open3d() { return false; }

std::vector<Contender> fuse_open3d(const FuseCase&, int) { return {}; }

}  // namespace mr::bench
