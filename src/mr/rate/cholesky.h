#pragma once

#include <vector>

namespace mr::rate {

/// Solves A x = b for a symmetric positive definite matrix ([n * n], row by row) by Cholesky
/// decomposition. Directions in which it is singular get 0.
std::vector<double> solve_spd(std::vector<double> a, std::vector<double> b);

}  // namespace mr::rate
