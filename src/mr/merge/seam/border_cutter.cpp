#include "mr/merge/seam/border_cutter.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "mr/kit/topology.h"

namespace mr::merge {
namespace {

constexpr int kMaxEdgeCuts = 6;  // halvings of a border edge

/// Recursive bisection of long border edges near another part's border.
class BorderCutter {
 public:
  BorderCutter(Joined& joined, const BorderMap& map, const ZipperConfig& config)
      : joined_(joined), longest_m_(static_cast<float>(1.5 * config.edge_m)) {
    const std::vector<std::uint8_t> near = map.has_other_near(joined);
    std::vector<std::uint32_t> triangles;  // that are cut
    for (std::size_t e = 0; e < near.size(); ++e)
      if (near[e] && is_long(joined.border[e])) triangles.push_back(joined.border[e] / 3);
    triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
    if (triangles.empty()) return;
    for (const std::uint32_t h : joined.border)
      if (!std::ranges::binary_search(triangles, h / 3)) border_.push_back(h);
    for (const std::uint32_t t : triangles) {
      place_ = whole_ = t;
      const Triangle whole = joined.mesh.triangles[t];
      cut(whole, flags(t), kMaxEdgeCuts);
    }
    std::ranges::sort(border_);
    joined.border = std::move(border_);
  }

 private:
  using Flags = std::array<std::uint8_t, 3>;  // of a triangle's edges

  bool is_long(std::uint32_t h) const {
    return length(at(kit::edge_from(joined_.mesh, h)) - at(kit::edge_to(joined_.mesh, h))) >
           longest_m_;
  }
  Flags flags(std::uint32_t t) const {
    const auto is_border = [&](std::uint32_t h) {
      return static_cast<std::uint8_t>(std::ranges::binary_search(joined_.border, h));
    };
    return {is_border(3 * t), is_border(3 * t + 1), is_border(3 * t + 2)};
  }

  /// Splits a triangle at the midpoints of its long border edges, recursively up to depth `times`.
  /// Border edges have no other triangle, so there are no T-junctions.
  void cut(const Triangle& t, const Flags& border, int times) {
    std::array<std::uint32_t, 3> middle{};
    std::array<bool, 3> is_cut{};
    for (std::uint32_t i = 0; i < 3; ++i) {
      is_cut[i] = border[i] && times > 0 && length(at(t[i]) - at(t[(i + 1) % 3])) > longest_m_;
      if (is_cut[i]) middle[i] = add_middle(t[i], t[(i + 1) % 3]);
    }
    const int cuts = is_cut[0] + is_cut[1] + is_cut[2];
    if (cuts == 0) {
      add(t, border);
    } else if (cuts == 1) {
      const int i = is_cut[0] ? 0 : is_cut[1] ? 1 : 2;
      const std::uint32_t a = t[i], b = t[(i + 1) % 3], c = t[(i + 2) % 3], ab = middle[i];
      cut({a, ab, c}, {1, 0, border[(i + 2) % 3]}, times - 1);
      cut({ab, b, c}, {1, border[(i + 1) % 3], 0}, times - 1);
    } else if (cuts == 2) {
      const int i = !is_cut[0] ? 0 : !is_cut[1] ? 1 : 2;  // the edge that stays whole
      const std::uint32_t a = t[i], b = t[(i + 1) % 3], c = t[(i + 2) % 3];
      const std::uint32_t bc = middle[(i + 1) % 3], ca = middle[(i + 2) % 3];
      cut({ca, bc, c}, {0, 1, 1}, times - 1);
      if (length(at(a) - at(bc)) <= length(at(b) - at(ca))) {  // the shorter diagonal
        cut({a, b, bc}, {border[i], 1, 0}, times - 1);
        cut({a, bc, ca}, {0, 0, 1}, times - 1);
      } else {
        cut({a, b, ca}, {border[i], 0, 1}, times - 1);
        cut({b, bc, ca}, {1, 0, 0}, times - 1);
      }
    } else {
      for (int i = 0; i < 3; ++i) cut({t[i], middle[i], middle[(i + 2) % 3]}, {1, 0, 1}, times - 1);
      add({middle[0], middle[1], middle[2]}, {0, 0, 0});
    }
  }

  /// Adds a triangle; the first one replaces the triangle that is split.
  void add(const Triangle& t, const Flags& border) {
    auto place = std::exchange(place_, kNoPlace);
    if (place == kNoPlace) {
      place = static_cast<std::uint32_t>(joined_.mesh.triangles.size());
      joined_.mesh.triangles.emplace_back();
      joined_.sensor.push_back(joined_.sensor[whole_]);
    }
    joined_.mesh.triangles[place] = t;
    for (std::uint32_t i = 0; i < 3; ++i)
      if (border[i]) border_.push_back(3 * place + i);
  }

  std::uint32_t add_middle(std::uint32_t a, std::uint32_t b) {
    joined_.mesh.positions.push_back((at(a) + at(b)) * 0.5f);
    joined_.part.push_back(joined_.part[a]);
    return static_cast<std::uint32_t>(joined_.part.size() - 1);
  }
  Vec3f at(std::uint32_t vertex) const { return joined_.mesh.positions[vertex]; }

  static constexpr std::uint32_t kNoPlace = 0xFFFFFFFFu;
  Joined& joined_;
  float longest_m_;
  std::vector<std::uint32_t> border_;           // anew
  std::uint32_t place_ = kNoPlace, whole_ = 0;  // whole_: the triangle that is cut
};

}  // namespace

void split_long_border_edges(Joined& joined, const BorderMap& map, const ZipperConfig& config) {
  BorderCutter(joined, map, config);
}

}  // namespace mr::merge
