#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mr/calib/residuals.h"

namespace mr::calib {

/// The parts that do not fit the others, in order. Two parts agree when their residual is at most
/// `limit_mm` and they share at least 85 % of what they should. Of parts that overlap, the largest
/// group that agrees among itself is taken for right, and those that disagree with most of it are
/// named. Where no group is the largest (as with two parts only), no one can tell: none is named.
std::vector<std::uint32_t> outliers(std::span<const PairResidual> residuals, std::size_t parts,
                                    double limit_mm);

}  // namespace mr::calib
