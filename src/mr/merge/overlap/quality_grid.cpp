#include "mr/merge/overlap/quality_grid.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/merge/cell.h"
#include "mr/merge/subdivide.h"

namespace mr::merge {
namespace {

constexpr int kMostCellPieces = 16;  // of a triangle's edges, when it is spread over cells

constexpr float kHeldChange = 0.1f;        // by how much a sum may change unnoticed
constexpr float kLeastNormalShare = 0.1f;  // of the surface in a cell, to count for its neighbours
constexpr std::uint32_t kNotHere = 0xFFFFFFFFu;
constexpr Vec3i kNowhere{1 << 30, 0, 0};

/// Fills the cells of one source of a part.
class Filler {
 public:
  explicit Filler(QualityCells& cells) : cells_(cells) {}

  void fill(const Mesh& mesh, const Measured& measured, std::uint32_t source, float per_cell) {
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      if (measured.source[t] != source) continue;
      const Vec3f a = mesh.corner(t, 0), ab = mesh.corner(t, 1) - a, ac = mesh.corner(t, 2) - a;
      const Vec3f across = cross(ab, ac);
      const float size = length(across);
      if (!(size > 0)) continue;
      const float longest = std::max({length(ab), length(ac), length(ac - ab)});
      const int n = static_cast<int>(
          std::clamp(std::ceil(longest * per_cell), 1.0f, static_cast<float>(kMostCellPieces)));
      const float share = 1 / (2 * size * static_cast<float>(n * n));
      QualitySums each;
      for (int axis = 0; axis < 3; ++axis) {
        each[axis] = across[axis] * across[axis] * share;
        each[axis + 3] = each[axis] * measured.quality[t];
      }
      for_each_subtriangle(n, [&](float b, float c) {
        QualitySums& here =
            cells_.sums[place_of(cell_key(cell_at((a + ab * b + ac * c) * per_cell)))];
        for (std::size_t i = 0; i < each.size(); ++i) here[i] += each[i];
      });
    }
    spread();
  }

  /// The index of a cell.
  std::uint32_t place_of(std::uint64_t cell) {
    const auto fresh = static_cast<std::uint32_t>(cells_.keys.size());
    const std::uint32_t place = cells_.places.get_or_add(cell, fresh);
    if (place == fresh) cells_.keys.push_back(cell), cells_.sums.push_back({});
    return place;
  }

  /// Filters the sums against aliasing of triangles and cells: a binomial filter (1 2 1)
  /// tangentially; along the normal the sum of a cell and its two neighbours, so that parts
  /// slightly in front of or behind each other get the same value.
  void spread() {
    const std::vector<std::uint64_t>& keys = cells_.keys;
    std::vector<QualitySums>& sums = cells_.sums;
    const std::size_t count = keys.size();
    for (int axis = 0; axis < 3; ++axis) {
      const std::vector<QualitySums> before = sums;
      for (std::size_t i = 0; i < count; ++i)
        for (const std::uint64_t neighbour :
             {keys[i] - kCellStep[axis], keys[i] + kCellStep[axis]}) {
          const std::uint32_t* other = cells_.places.find(neighbour);
          if (!other) continue;
          for (int k = 0; k < 6; ++k)
            if (k % 3 != axis) sums[i][k] += 0.25f * (before[*other][k] - before[i][k]);
        }
    }
    const std::vector<QualitySums> before = sums;
    for (std::size_t i = 0; i < count; ++i)
      for (int axis = 0; axis < 3; ++axis) {
        const QualitySums& here = before[i];
        if (here[axis] < kLeastNormalShare * (here[0] + here[1] + here[2])) continue;
        for (const std::uint64_t beside : {keys[i] - kCellStep[axis], keys[i] + kCellStep[axis]}) {
          QualitySums& there = sums[place_of(beside)];
          there[axis] += here[axis], there[axis + 3] += here[axis + 3];
        }
      }
  }

  QualityCells& cells_;
};

}  // namespace

void QualityMemory::stabilize(SensorId sensor, QualityCells& cells) const {
  const QualityCells* found = nullptr;
  {
    const std::lock_guard lock(mutex_);
    const auto known = last_.find(sensor);
    if (known == last_.end()) return;
    found = &known->second;
  }
  const QualityCells& last = *found;
  for (std::size_t i = 0; i < cells.keys.size(); ++i) {
    const std::uint32_t* before = last.places.find(cells.keys[i]);
    if (!before) continue;
    for (std::size_t k = 0; k < cells.sums[i].size(); ++k) {
      const float held = last.sums[*before][k];
      if (std::abs(cells.sums[i][k] - held) <= kHeldChange * held) cells.sums[i][k] = held;
    }
  }
}

void QualityMemory::learn(SensorId sensor, const QualityCells& cells) {
  QualityCells* last = nullptr;
  {
    const std::lock_guard lock(mutex_);
    last = &last_[sensor];
  }
  *last = cells;
}

QualityGrid::QualityGrid(std::span<const kit::Part> parts, std::span<const Measured> measured,
                         double cell_m, QualityMemory* memory, bool learns)
    : per_cell_(static_cast<float>(1 / cell_m)), cells_(1024) {
  for (std::uint32_t i = 0; i < parts.size(); ++i)
    for (std::uint32_t source = 0; source < parts[i].sources.size(); ++source)
      owners_.push_back({i, source});
  std::vector<QualityCells> of_owner(owners_.size());
  parallel_for(owners_.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const auto [part, source] = owners_[k];
      Filler(of_owner[k]).fill(parts[part].mesh, measured[part], source, per_cell_);
    }
  });
  for (std::size_t k = 0; memory && k < owners_.size(); ++k) {
    const SensorId sensor = parts[owners_[k].part].sources[owners_[k].source].sensor;
    memory->stabilize(sensor, of_owner[k]);
    if (learns) memory->learn(sensor, of_owner[k]);
  }
  std::vector<std::uint32_t> count, place;
  for (const QualityCells& cells : of_owner)
    for (const std::uint64_t cell : cells.keys) {
      place.push_back(cells_.get_or_add(cell, static_cast<std::uint32_t>(count.size())));
      if (place.back() == count.size()) count.push_back(0);
      ++count[place.back()];
    }
  first_.assign(count.size() + 1, 0);
  for (std::size_t c = 0; c < count.size(); ++c) first_[c + 1] = first_[c] + count[c];
  entries_.resize(place.size());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  const std::uint32_t* at = place.data();
  for (std::uint32_t k = 0; k < of_owner.size(); ++k)
    for (const QualitySums& sums : of_owner[k].sums) entries_[next[*at++]++] = {k, sums};
}

QualityGrid::Reader::Reader(const QualityGrid& grid)
    : grid_(grid), cache_(kCached), place_(grid.owners_.size(), kNotHere) {
  for (Around& none : cache_) none.cell = kNowhere;
}

std::span<const QualityGrid::Candidate> QualityGrid::Reader::at(Vec3f place, Vec3f normal) {
  const Vec3f in_cells = place * grid_.per_cell_ - Vec3f{0.5f, 0.5f, 0.5f};
  const Vec3i cell = cell_at(in_cells);
  const Around& here = around(cell);
  const Vec3f f = in_cells - vec_cast<float>(cell);
  std::array<float, 24> share;  // of each cell's three sums
  for (int c = 0; c < 8; ++c) {
    const float w = (c & 1 ? f.x : 1 - f.x) * (c & 2 ? f.y : 1 - f.y) * (c & 4 ? f.z : 1 - f.z);
    for (int axis = 0; axis < 3; ++axis) share[3 * c + axis] = w * normal[axis] * normal[axis];
  }
  area_.resize(here.sums.size() * kFour), quality_.resize(area_.size());
  for (std::size_t k = 0; k < here.sums.size(); ++k) {
    std::array<float, kFour> area{}, quality{};
    for (std::size_t i = 0; i < share.size(); ++i)
      for (std::size_t j = 0; j < kFour; ++j) {
        area[j] += share[i] * here.sums[k].area[i][j];
        quality[j] += share[i] * here.sums[k].quality[i][j];
      }
    std::ranges::copy(area, area_.begin() + kFour * k);
    std::ranges::copy(quality, quality_.begin() + kFour * k);
  }
  out_.clear();
  const std::size_t count = here.owners.size();
  for (std::size_t i = 0; i < count;) {
    const std::uint32_t part = grid_.owners_[here.owners[i]].part;
    std::size_t end = i;
    float of_part = 0;
    for (; end < count && grid_.owners_[here.owners[end]].part == part; ++end)
      of_part += area_[end];
    // Towards a part's borders it falls off; borders between its sources do not count.
    const float taper = std::sqrt(std::sqrt(std::sqrt(of_part)));
    for (; i < end; ++i)
      if (area_[i] > 0)
        out_.push_back(
            {grid_.owners_[here.owners[i]], here.owners[i], quality_[i] / area_[i] * taper});
  }
  return out_;
}

const QualityGrid::Reader::Around& QualityGrid::Reader::around(Vec3i cell) {
  Around& here = cache_[hash_cell(cell) % kCached];
  if (here.cell != cell) gather(cell, here);
  return here;
}

void QualityGrid::Reader::gather(Vec3i cell, Around& out) {
  out.cell = cell;
  out.owners.clear();
  std::array<std::span<const Entry>, 8> entries;
  for (int c = 0; c < 8; ++c) {
    const std::uint32_t* known =
        grid_.cells_.find(cell_key(cell + Vec3i{c & 1, c >> 1 & 1, c >> 2}));
    if (!known) continue;
    const std::uint32_t begin = grid_.first_[*known], end = grid_.first_[*known + 1];
    entries[c] = std::span(grid_.entries_).subspan(begin, end - begin);
    for (const Entry& entry : entries[c])
      if (std::exchange(place_[entry.owner], 0) == kNotHere) out.owners.push_back(entry.owner);
  }
  std::ranges::sort(out.owners);
  for (std::uint32_t i = 0; i < out.owners.size(); ++i) place_[out.owners[i]] = i;
  out.sums.assign((out.owners.size() + kFour - 1) / kFour, {});
  for (std::size_t c = 0; c < 8; ++c)
    for (const auto& [owner, sums] : entries[c]) {
      Four& four = out.sums[place_[owner] / kFour];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        four.area[3 * c + axis][place_[owner] % kFour] = sums[axis];
        four.quality[3 * c + axis][place_[owner] % kFour] = sums[axis + 3];
      }
    }
  for (const std::uint32_t owner : out.owners) place_[owner] = kNotHere;
}

}  // namespace mr::merge
