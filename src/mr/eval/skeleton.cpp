#include "mr/eval/skeleton.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "mr/core/assert.h"

namespace mr::eval {
namespace {

/// Lower envelope of the parabolas f(q) + (p - q)²: which q is lowest at each p; -1 where all of f
/// are infinite.
class LowerEnvelope {
 public:
  explicit LowerEnvelope(int longest) : parabola_(longest), from_(longest + 1) {}

  template <typename F, typename Out>
  void lowest(int count, const F& f, const Out& out) {
    constexpr double kNone = std::numeric_limits<double>::infinity();
    int last = -1;
    for (int q = 0; q < count; ++q) {
      if (f(q) == kNone) continue;
      double s = -kNone;
      for (; last >= 0; --last) {
        const int v = parabola_[last];
        s = (f(q) + static_cast<double>(q) * q - f(v) - static_cast<double>(v) * v) /
            (2.0 * (q - v));
        if (s > from_[last]) break;
      }
      if (last < 0) s = -kNone;
      parabola_[++last] = q;
      from_[last] = s;
    }
    for (int p = 0, k = 0; p < count; ++p) {
      while (k < last && from_[k + 1] < p) ++k;
      out(p, last < 0 ? -1 : parabola_[k]);
    }
  }

 private:
  std::vector<int> parabola_;
  std::vector<double> from_;
};

/// Whether removing a cell changes neither the parts of the mask (8-connected) nor the holes
/// between them: its connectivity number (Yokoi, Toriwaki and Fukumura 1975) is one.
bool removable(const std::vector<std::uint8_t>& mask, std::int32_t cell, int width) {
  const auto around = ring(cell, width);
  int number = 0;
  for (int k = 0; k < 8; k += 2) {
    const bool here = !mask[around[k]], next = !mask[around[k + 1]],
               after = !mask[around[(k + 2) % 8]];
    number += here && !(next && after);
  }
  return number == 1;
}

int neighbours(const std::vector<std::uint8_t>& mask, std::int32_t cell, int width) {
  int count = 0;
  for (const std::int32_t n : ring(cell, width)) count += mask[n];
  return count;
}

/// Cells between two obstacles: what is nearest changes from them to a neighbour, to another
/// direction by at least 75 degrees (a bump on a wall turns it less, a right-angled corner more).
std::vector<std::uint8_t> ridge(const FloorMap& map, const std::vector<std::int32_t>& nearest) {
  const double least = 2 * std::sin(0.5 * 75 * std::numbers::pi / 180);
  std::vector<std::uint8_t> out(map.cells.size());
  const auto check = [&](std::int32_t a, std::int32_t b) {
    const double dx = nearest[a] % map.width - nearest[b] % map.width;
    const double dy = nearest[a] / map.width - nearest[b] / map.width;
    const double away_m = 0.5 * (map.clearance_m[a] + map.clearance_m[b]);
    if (std::hypot(dx, dy) * map.cell_m < least * away_m) return;
    out[map.clearance_m[a] >= map.clearance_m[b] ? a : b] = 1;
  };
  for (std::int32_t y = 1; y < map.height - 1; ++y)
    for (std::int32_t x = 1; x < map.width - 1; ++x) {
      const std::int32_t cell = y * map.width + x;
      if (map.cells[cell] != FloorMap::free) continue;
      check(cell, cell + 1), check(cell, cell + map.width);
    }
  return out;
}

/// Takes cells off `mask` from the outside in (distance-ordered homotopic thinning, Pudney 1998):
/// first all but the ridge, then all but one cell's width.
void thin(std::vector<std::uint8_t>& mask, const std::vector<std::uint8_t>& kept,
          const FloorMap& map) {
  std::vector<std::int32_t> order;
  for (std::size_t i = 0; i < mask.size(); ++i)
    if (mask[i]) order.push_back(static_cast<std::int32_t>(i));
  std::stable_sort(order.begin(), order.end(),
                   [&](auto a, auto b) { return map.clearance_m[a] < map.clearance_m[b]; });
  const auto take_off = [&](const auto& may_go) {
    for (std::size_t before = 0; before != order.size();) {
      before = order.size();
      std::erase_if(order, [&](std::int32_t cell) {
        if (!may_go(cell) || !removable(mask, cell, map.width)) return false;
        mask[cell] = 0;
        return true;
      });
    }
  };
  take_off([&](std::int32_t cell) { return !kept[cell]; });
  take_off([&](std::int32_t cell) { return neighbours(mask, cell, map.width) > 1; });
}

}  // namespace

std::array<std::int32_t, 8> ring(std::int32_t cell, int width) {
  return {cell + 1, cell + 1 - width, cell - width, cell - 1 - width,
          cell - 1, cell - 1 + width, cell + width, cell + 1 + width};
}

std::vector<std::int32_t> nearest_seed(const std::vector<std::uint8_t>& seeds, int width,
                                       int height) {
  MR_ASSERT(seeds.size() == static_cast<std::size_t>(width) * height);
  constexpr double kNone = std::numeric_limits<double>::infinity();
  LowerEnvelope envelope(std::max(width, height));
  std::vector<std::int32_t> in_column(seeds.size()), out(seeds.size());
  for (int x = 0; x < width; ++x)
    envelope.lowest(
        height, [&](int y) { return seeds[static_cast<std::size_t>(y) * width + x] ? 0 : kNone; },
        [&](int y, int row) { in_column[static_cast<std::size_t>(y) * width + x] = row; });
  for (int y = 0; y < height; ++y) {
    const std::int32_t* const rows = in_column.data() + static_cast<std::size_t>(y) * width;
    envelope.lowest(
        width,
        [&](int x) {
          return rows[x] < 0 ? kNone : static_cast<double>(rows[x] - y) * (rows[x] - y);
        },
        [&](int x, int column) {
          out[static_cast<std::size_t>(y) * width + x] =
              column < 0 ? -1 : rows[column] * width + column;
        });
  }
  return out;
}

std::vector<std::int32_t> measure_clearance(FloorMap& map) {
  std::vector<std::uint8_t> seeds(map.cells.size());
  for (std::size_t i = 0; i < seeds.size(); ++i) seeds[i] = map.cells[i] != FloorMap::free;
  const std::vector<std::int32_t> nearest = nearest_seed(seeds, map.width, map.height);
  map.clearance_m.resize(map.cells.size());
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(seeds.size()); ++i)
    map.clearance_m[i] =
        static_cast<float>(map.cell_m * std::hypot(i % map.width - nearest[i] % map.width,
                                                   i / map.width - nearest[i] / map.width));
  return nearest;
}

std::vector<std::uint8_t> walkable(const FloorMap& map, double clearance_m) {
  std::vector<std::uint8_t> out(map.cells.size());
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = map.clearance_m[i] >= clearance_m - 1e-6;
  return out;
}

ConnectedComponents connected_components(const std::vector<std::uint8_t>& mask, int width,
                                         bool diagonal) {
  ConnectedComponents out{std::vector<std::int32_t>(mask.size(), -1), 0};
  std::vector<std::int32_t> open;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (!mask[i] || out.of_cell[i] >= 0) continue;
    out.of_cell[i] = out.count;
    open.push_back(static_cast<std::int32_t>(i));
    while (!open.empty()) {
      const auto around = ring(open.back(), width);
      open.pop_back();
      for (int k = 0; k < 8; k += diagonal ? 1 : 2)
        if (mask[around[k]] && out.of_cell[around[k]] < 0)
          out.of_cell[around[k]] = out.count, open.push_back(around[k]);
    }
    ++out.count;
  }
  return out;
}

void find_skeleton(FloorMap& map, double clearance_m) {
  const std::vector<std::int32_t> nearest = measure_clearance(map);
  map.skeleton = walkable(map, clearance_m);
  thin(map.skeleton, ridge(map, nearest), map);
}

std::vector<std::vector<std::int32_t>> components(const FloorMap& map) {
  const ConnectedComponents parts = connected_components(map.skeleton, map.width, true);
  std::vector<std::vector<std::int32_t>> cells(parts.count);
  for (std::size_t i = 0; i < map.skeleton.size(); ++i)
    if (parts.of_cell[i] >= 0) cells[parts.of_cell[i]].push_back(static_cast<std::int32_t>(i));
  std::stable_sort(cells.begin(), cells.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return cells;
}

}  // namespace mr::eval
