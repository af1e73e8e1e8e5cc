#include "mr/planner/sensor_clusters.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace mr::planner {
namespace {

/// Joins group `b` to group `a` < b.
void join(SensorClusters& c, std::size_t a, std::size_t b) {
  for (std::size_t w = 0; w < c.groups[a].size(); ++w) c.groups[a][w] |= c.groups[b][w];
  const double sum = c.cost[a] + c.cost[b];
  c.middle[a] = c.middle[a] * (c.cost[a] / sum) + c.middle[b] * (c.cost[b] / sum);
  c.cost[a] = sum;
  for (std::size_t k = 0; k < c.groups.size(); ++k)
    if (k != a) c.shared[k][a] = c.shared[a][k] += c.shared[b][k];
  const auto at = static_cast<std::ptrdiff_t>(b);
  for (auto& row : c.shared) row.erase(row.begin() + at);
  c.shared.erase(c.shared.begin() + at);
  c.groups.erase(c.groups.begin() + at);
  c.cost.erase(c.cost.begin() + at);
  c.middle.erase(c.middle.begin() + at);
}

/// Joins the two groups that share most of what they see (those that are nearest, where none
/// shares any) and have not more than `most` to do together; false where there are none.
bool join_best(SensorClusters& c, double most) {
  std::optional<std::pair<std::size_t, std::size_t>> best;
  std::pair<double, double> best_key;
  for (std::size_t a = 0; a < c.groups.size(); ++a)
    for (std::size_t b = a + 1; b < c.groups.size(); ++b) {
      if (c.cost[a] + c.cost[b] > most) continue;
      const std::pair key(c.shared[a][b] / (c.cost[a] * c.cost[b]),
                          -length(c.middle[a] - c.middle[b]));
      if (!best || key > best_key) best = {a, b}, best_key = key;
    }
  if (best) join(c, best->first, best->second);
  return best.has_value();
}

}  // namespace

SensorClusters one_each(const Coverage& coverage) {
  const std::size_t n = coverage.sensors();
  SensorClusters out;
  out.groups.assign(n, coverage.none());
  out.middle.assign(n, {});
  out.shared.assign(n, std::vector<double>(n, 0));
  for (std::size_t i = 0; i < n; ++i) {
    put(out.groups[i], i);
    out.cost.push_back(std::max(coverage.triangles[i], 1.0));
  }
  for (const SurfacePoint& point : coverage.points) {
    out.middle[point.sensor] += point.at * (point.triangles / coverage.triangles[point.sensor]);
    for (std::size_t j = 0; j < n; ++j) {
      if (j == point.sensor || !has(point.seen, j)) continue;
      out.shared[point.sensor][j] += point.triangles;
      out.shared[j][point.sensor] += point.triangles;
    }
  }
  return out;
}

SensorClusters clustered(SensorClusters c, std::size_t wanted, double slack) {
  double total = 0;
  for (const double cost : c.cost) total += cost;
  double most = slack * total / static_cast<double>(wanted);
  while (c.groups.size() > wanted)
    if (!join_best(c, most)) most *= 1.1;
  return c;
}

}  // namespace mr::planner
