#include "mr/merge/seam/border_map.h"

#include <algorithm>
#include <cmath>

#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/merge/cell.h"

namespace mr::merge {
namespace {

constexpr float kMostSamples = 4096;        // of one edge
constexpr std::size_t kEdgesAtOnce = 4096;  // edges per parallel task
constexpr std::uint32_t kSeveral = 0xFFFFFFFFu;

}  // namespace

BorderMap::BorderMap(const Joined& joined, double reach_m)
    : per_cell_(static_cast<float>(1 / reach_m)), place_(joined.border.size() / 4) {
  struct Passed {
    Vec3i cell;
    std::uint32_t part;
    bool operator==(const Passed&) const = default;
  };
  std::vector<std::vector<Passed>> blocks((joined.border.size() + kEdgesAtOnce - 1) / kEdgesAtOnce);
  const auto pass = [&](std::uint32_t half_edge, std::vector<Passed>& block) {
    const std::uint32_t part = joined.part[kit::edge_from(joined.mesh, half_edge)];
    for_each_cell(joined, half_edge, [&](Vec3i cell) {
      if (const Passed passed{cell, part}; block.empty() || block.back() != passed)
        block.push_back(passed);
    });
  };
  parallel_for(blocks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b)
      for (std::size_t e = b * kEdgesAtOnce;
           e < std::min((b + 1) * kEdgesAtOnce, joined.border.size()); ++e)
        pass(joined.border[e], blocks[b]);
  });
  std::vector<Vec3i> cells;
  std::vector<std::uint32_t> part;  // [cells] the only one with border there, or kSeveral
  for (const std::vector<Passed>& block : blocks)
    for (const auto& [cell, its] : block) {
      const auto fresh = static_cast<std::uint32_t>(cells.size());
      const std::uint32_t place = place_.get_or_add(hash_cell(cell), fresh);
      if (place == fresh) cells.push_back(cell), part.push_back(its);
      if (part[place] != its) part[place] = kSeveral;
    }
  is_near_.resize(cells.size());
  parallel_for(cells.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c < end; ++c)
      for (int i = 0; i < 27 && !is_near_[c]; ++i) {
        const Vec3i beside = cells[c] + Vec3i{i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
        const std::uint32_t* place = place_.find(hash_cell(beside));
        is_near_[c] = place && (part[*place] == kSeveral || part[*place] != part[c]);
      }
  });
}

std::vector<std::uint8_t> BorderMap::has_other_near(const Joined& joined) const {
  std::vector<std::uint8_t> out(joined.border.size());
  parallel_for(out.size(), kEdgesAtOnce, [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) out[e] = has_other_near(joined, joined.border[e]);
  });
  return out;
}

bool BorderMap::has_other_near(const Joined& joined, std::uint32_t half_edge) const {
  bool found = false;
  for_each_cell(joined, half_edge, [&](Vec3i cell) {
    const std::uint32_t* place = place_.find(hash_cell(cell));
    found = found || !place || is_near_[*place];
  });
  return found;
}

/// The cells that an edge passes, a few of them skipped at most where it cuts a corner of one.
template <typename Visit>
void BorderMap::for_each_cell(const Joined& joined, std::uint32_t half_edge, Visit&& visit) const {
  const Vec3f a = joined.mesh.positions[kit::edge_from(joined.mesh, half_edge)] * per_cell_,
              b = joined.mesh.positions[kit::edge_to(joined.mesh, half_edge)] * per_cell_;
  const float wanted = std::ceil(2 * length(b - a));
  const int steps = static_cast<int>(std::clamp(wanted, 1.0f, kMostSamples));
  Vec3i last = cell_at(a);
  visit(last);
  for (int i = 1; i <= steps; ++i) {
    const Vec3i cell = cell_at(a + (b - a) * (static_cast<float>(i) / static_cast<float>(steps)));
    if (cell != last) visit(cell);
    last = cell;
  }
}

}  // namespace mr::merge
