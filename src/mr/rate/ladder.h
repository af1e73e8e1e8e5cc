#pragma once

#include <cstddef>
#include <vector>

namespace mr::rate {

/// The most streams that viewers are served by.
inline constexpr int kMostRungs = 3;

/// The rates of at most `most` streams ("rungs") for viewers who want these rates, falling. A rung
/// has the least rate of its viewers, so that nobody gets more than it wants. As few rungs as give
/// everyone most of what it wants; else those by which viewers lose least, by the logarithm, summed
/// over them.
/// `wanted`: above 0. `most` > 0. Empty: nobody wants anything.
std::vector<double> ladder_for(std::vector<double> wanted, std::size_t most);

/// The rung of a viewer: the highest one within what it wants, else the lowest. `ladder`: falling,
/// not empty.
std::size_t rung_for(double wanted, const std::vector<double>& ladder);

}  // namespace mr::rate
