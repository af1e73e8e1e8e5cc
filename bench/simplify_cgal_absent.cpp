#include "simplify_contenders.h"

namespace mr::bench {

bool has_cgal() { return false; }

std::vector<Contender> simplify_cgal(const SimplifyCase&) { return {}; }

}  // namespace mr::bench
