#include "simplify_contenders.h"

namespace mr::bench {

std::vector<Contender> simplify_open3d(const SimplifyCase&) { return {}; }

}  // namespace mr::bench
