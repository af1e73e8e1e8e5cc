#include "mr/rate/cholesky.h"

#include <cmath>
#include <cstddef>

#include "mr/core/assert.h"

namespace mr::rate {

std::vector<double> solve_spd(std::vector<double> a, std::vector<double> b) {
  const std::size_t n = b.size();
  MR_ASSERT(a.size() == n * n);
  const auto at = [&](std::size_t r, std::size_t c) -> double& { return a[r * n + c]; };
  for (std::size_t c = 0; c < n; ++c) {
    const double whole = at(c, c);
    for (std::size_t k = 0; k < c; ++k) at(c, c) -= at(c, k) * at(c, k);
    const bool is_singular = !(at(c, c) > 1e-12 * whole);
    at(c, c) = is_singular ? 0 : std::sqrt(at(c, c));
    for (std::size_t r = c + 1; r < n; ++r) {
      for (std::size_t k = 0; k < c; ++k) at(r, c) -= at(r, k) * at(c, k);
      at(r, c) = is_singular ? 0 : at(r, c) / at(c, c);
    }
  }
  const auto divided = [&](double v, std::size_t i) { return at(i, i) > 0 ? v / at(i, i) : 0; };
  for (std::size_t r = 0; r < n; ++r) {
    for (std::size_t k = 0; k < r; ++k) b[r] -= at(r, k) * b[k];
    b[r] = divided(b[r], r);
  }
  for (std::size_t r = n; r-- > 0;) {
    for (std::size_t k = r + 1; k < n; ++k) b[r] -= at(k, r) * b[k];
    b[r] = divided(b[r], r);
  }
  return b;
}

}  // namespace mr::rate
