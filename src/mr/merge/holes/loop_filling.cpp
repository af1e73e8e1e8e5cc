#include "mr/merge/holes/loop_filling.h"

#include <cstdint>
#include <limits>
#include <utility>

namespace mr::merge {

std::optional<std::vector<Triangle>> least_filling(std::uint32_t corners, const FillingRule& rule) {
  constexpr double kImpossible = std::numeric_limits<double>::infinity();
  if (corners < 3) return std::nullopt;
  struct Best {
    double cost = 0;
    std::uint32_t middle = 0;
  };
  std::vector<Best> best(static_cast<std::size_t>(corners) * corners);  // of what lies in i..k
  const auto at = [&](std::uint32_t i, std::uint32_t k) -> Best& { return best[i * corners + k]; };
  for (std::uint32_t span = 2; span < corners; ++span)
    for (std::uint32_t i = 0; i + span < corners; ++i) {
      const std::uint32_t k = i + span;
      Best found{kImpossible, i};
      const bool is_edge = (i == 0 && k + 1 == corners) || rule.may_join(i, k);
      for (std::uint32_t j = i + 1; j < k && is_edge; ++j) {
        const double parts = at(i, j).cost + at(j, k).cost;
        if (parts >= found.cost) continue;
        const auto own = rule.cost(i, j, k);
        if (own && parts + *own < found.cost) found = {parts + *own, j};
      }
      at(i, k) = found;
    }
  if (at(0, corners - 1).cost == kImpossible) return std::nullopt;
  std::vector<Triangle> out;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> open{{0, corners - 1}};
  while (!open.empty()) {
    const auto [i, k] = open.back();
    open.pop_back();
    if (k - i < 2) continue;
    const std::uint32_t j = at(i, k).middle;
    out.push_back({k, j, i});
    open.push_back({j, k});
    open.push_back({i, j});
  }
  return out;
}

}  // namespace mr::merge
