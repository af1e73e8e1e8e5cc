#include "mr/rate/ladder.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "mr/core/assert.h"

namespace mr::rate {
namespace {

/// Splits falling rates into exactly so many runs, each served at its last: dynamic programming
/// over where runs begin.
std::vector<double> split(const std::vector<double>& falling, std::size_t rungs) {
  const std::size_t n = falling.size();
  constexpr double kNever = std::numeric_limits<double>::infinity();
  // loss[r][i]: the least of the first i viewers with r rungs; begin[r][i]: of the last rung then.
  std::vector<std::vector<double>> loss(rungs + 1, std::vector<double>(n + 1, kNever));
  std::vector<std::vector<std::size_t>> begin(rungs + 1, std::vector<std::size_t>(n + 1, 0));
  loss[0][0] = 0;
  for (std::size_t r = 1; r <= rungs; ++r)
    for (std::size_t end = 1; end <= n; ++end) {
      double of_rung = 0;
      for (std::size_t from = end; from-- > 0;) {
        of_rung += std::log(falling[from] / falling[end - 1]);
        if (loss[r - 1][from] + of_rung >= loss[r][end]) continue;
        loss[r][end] = loss[r - 1][from] + of_rung, begin[r][end] = from;
      }
    }
  std::vector<double> out;
  for (std::size_t r = rungs, end = n; r > 0; end = begin[r--][end])
    out.push_back(falling[end - 1]);
  std::ranges::reverse(out);
  return out;
}

}  // namespace

std::vector<double> ladder_for(std::vector<double> wanted, std::size_t most) {
  MR_ASSERT(most > 0);
  constexpr double kMost = 0.8;          // of what a viewer wants
  constexpr std::size_t kViewers = 256;  // beyond that, a sample: the time grows with the square
  std::ranges::sort(wanted, std::greater<>());
  if (wanted.size() > kViewers) {
    std::vector<double> sample;
    for (std::size_t i = 1; i <= kViewers; ++i)
      sample.push_back(wanted[i * wanted.size() / kViewers - 1]);
    wanted = std::move(sample);
  }
  std::vector<double> out;
  for (std::size_t rungs = 1; rungs <= std::min(most, wanted.size()); ++rungs) {
    out = split(wanted, rungs);
    if (std::ranges::all_of(wanted, [&](double w) { return out[rung_for(w, out)] >= kMost * w; }))
      break;
  }
  return out;
}

std::size_t rung_for(double wanted, const std::vector<double>& ladder) {
  MR_ASSERT(!ladder.empty());
  const auto at = std::ranges::find_if(ladder, [&](double mbps) { return mbps <= wanted; });
  return std::min<std::size_t>(static_cast<std::size_t>(at - ladder.begin()), ladder.size() - 1);
}

}  // namespace mr::rate
