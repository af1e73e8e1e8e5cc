#include "simplify_contenders.h"

namespace mr::bench {

bool has_meshoptimizer() { return false; }

std::vector<Contender> simplify_meshoptimizer(const SimplifyCase&, const std::vector<int>&) {
  return {};
}

}  // namespace mr::bench
