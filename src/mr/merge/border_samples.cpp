#include "mr/merge/border_samples.h"

#include <algorithm>
#include <cmath>

#include "mr/kit/topology.h"

namespace mr::merge {
namespace {

constexpr double kMostSamples = 4096;  // of one edge
constexpr std::uint32_t kSeveral = 0xFFFFFFFFu;

std::uint64_t key(Vec3i cell) { return hash_cell(cell); }  // a collision costs a closer look

}  // namespace

TaggedPoints sample_border(const Joined& joined, double spacing) {
  TaggedPoints cloud;
  for (std::uint32_t e = 0; e < joined.border.size(); ++e) {
    const std::uint32_t h = joined.border[e];
    const Vec3f p = joined.mesh.positions[kit::edge_from(joined.mesh, h)],
                q = joined.mesh.positions[kit::edge_to(joined.mesh, h)];
    const double wanted = std::ceil(static_cast<double>(length(q - p)) / spacing);
    const int steps = static_cast<int>(std::clamp(wanted, 1.0, kMostSamples));
    for (int i = 0; i < steps; ++i) {
      const float along = (static_cast<float>(i) + 0.5f) / static_cast<float>(steps);
      cloud.points.push_back(p + (q - p) * along);
      cloud.tag.push_back(e);
    }
  }
  return cloud;
}

PartsNearby::PartsNearby(const Joined& joined, const TaggedPoints& samples, float most_m)
    : per_cell_(1 / (2 * most_m)), cells_(samples.points.size() / 4) {
  for (std::size_t i = 0; i < samples.points.size(); ++i) {
    const std::uint32_t h = joined.border[samples.tag[i]];
    const std::uint32_t part = joined.part[kit::edge_from(joined.mesh, h)];
    std::uint32_t& known = cells_.get_or_add(key(cell(samples.points[i], 0)), part);
    if (known != part) known = kSeveral;
  }
}

bool PartsNearby::has_other(Vec3f middle, std::uint32_t part) const {
  const Vec3i low = cell(middle, -0.5f);  // a ball of half a cell lies in eight
  for (int i = 0; i < 8; ++i) {
    const std::uint32_t* known = cells_.find(key(low + Vec3i{i & 1, i >> 1 & 1, i >> 2 & 1}));
    if (known && *known != part) return true;
  }
  return false;
}

Vec3i PartsNearby::cell(Vec3f p, float shift) const {
  const auto along = [&](float x) {
    return static_cast<std::int32_t>(std::clamp(std::floor(x * per_cell_ + shift), -1e9f, 1e9f));
  };
  return {along(p.x), along(p.y), along(p.z)};
}

}  // namespace mr::merge
