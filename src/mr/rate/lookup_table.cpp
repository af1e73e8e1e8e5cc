#include "mr/rate/lookup_table.h"

#include <iterator>
#include <limits>

#include "mr/core/assert.h"
#include "mr/rate/hull_targets.h"
#include "mr/rate/swept_surface.h"

namespace mr::rate {
namespace {

constexpr int kEntries = 16;  // of a scene

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

}  // namespace

LookupTable LookupTable::train(std::span<const Sweep> training) {
  LookupTable out;
  out.space_ = FeatureSpace(training);
  for (const Sweep& sweep : training) {
    const RateSurface surface(grid_values(sweep));
    std::vector<std::optional<int>> lattices{std::nullopt};  // which may be chosen
    lattices.insert(lattices.end(), std::begin(kLattices), std::end(kLattices));
    for (const auto& bits : lattices) {
      Row row{sweep.layers, out.space_.at(sweep.features), {}, bits};
      const auto hull = convex_hull(candidate_points(surface, bits));
      for (const double mbps : targets_of(hull, kEntries))
        row.entries.push_back({mbps, best_within(hull, mbps).setting});
      out.rows_.push_back(std::move(row));
    }
  }
  return out;
}

Setting LookupTable::choose(const Observation& observed, double target_mbps) const {
  MR_ASSERT(!rows_.empty());
  const std::vector<double> features = space_.at(observed.features);
  const Row* nearest = nullptr;
  double least = std::numeric_limits<double>::max();
  for (const Row& row : rows_) {
    // Rows of another kind only where there are none of this one.
    const double away = distance(row.features, features) +
                        (row.layers == observed.layers ? 0 : 2e6) +
                        (row.bits == observed.bits ? 0 : 1e6);
    if (away < least) least = away, nearest = &row;
  }
  Setting out = nearest->entries.front().setting;
  for (const Entry& entry : nearest->entries)
    if (entry.mbps <= target_mbps) out = entry.setting;
  if (observed.bits) out.bits = *observed.bits;
  return out;
}

}  // namespace mr::rate
