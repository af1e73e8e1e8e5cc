#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mr/calib/residuals.h"

namespace mr::calib {

/// The parts whose calibration contradicts the others, ascending. Two parts agree if their residual
/// is at most `limit_mm` and they share at least 85 % of the expected area. Among parts that
/// overlap, the largest connected component of the graph of agreement is the consensus, less those
/// members that disagree with most of it; outliers are the parts outside that disagree with most of
/// it. Without a unique largest component, as with two parts only, there are no outliers.
std::vector<std::uint32_t> outliers(std::span<const PairResidual> residuals, std::size_t parts,
                                    double limit_mm);

}  // namespace mr::calib
