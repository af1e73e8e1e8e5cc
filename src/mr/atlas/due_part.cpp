#include "mr/atlas/due_part.h"

#include <algorithm>
#include <utility>

#include "mr/kit/topology.h"

namespace mr::atlas {
namespace {

constexpr std::uint32_t kNoVertex = 0xFFFFFFFFu;

/// [T] due triangles and the rings of triangles around them.
std::vector<std::uint8_t> near_due(const Labelling& whole, int rings) {
  const kit::VertexFans fans(whole.mesh);
  std::vector<std::uint8_t> near = whole.is_due, is_reached(whole.mesh.positions.size());
  std::vector<std::uint32_t> reached;
  const auto reach = [&](std::uint32_t t) {
    for (const std::uint32_t v : whole.mesh.triangles[t])
      if (!std::exchange(is_reached[v], 1)) reached.push_back(v);
  };
  for (std::uint32_t t = 0; t < near.size(); ++t)
    if (near[t]) reach(t);
  for (int ring = 0; ring < rings; ++ring)
    for (const std::uint32_t v : std::exchange(reached, {}))
      for (const std::uint32_t t : fans.at(v))
        if (!std::exchange(near[t], 1)) reach(t);
  return near;
}

/// Fills regions of one label from triangles on.
class RegionFill {
 public:
  explicit RegionFill(const Labelling& surface)
      : surface_(surface),
        twin_(kit::edge_table(surface.mesh).twin),
        fill_of_(surface.label.size()) {}

  bool is_done(std::uint32_t t) const { return fill_of_[t] > 0; }

  /// Calls with the triangles across the edges of `t`.
  template <typename Function>
  void for_each_beside(std::uint32_t t, const Function& call) const {
    for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h)
      if (twin_[h] != kit::kNoTwin) call(twin_[h] / 3);
  }

  /// The region of a triangle that is not done; empty: its area is not below `below_m2`.
  std::vector<std::uint32_t> region(std::uint32_t seed, double below_m2) {
    std::vector<std::uint32_t> out{seed};
    fill_of_[seed] = ++fills_;
    double area_m2 = 0;
    bool is_small = true;
    for (std::size_t i = 0; i < out.size() && is_small; ++i) {
      area_m2 += 0.5 * length(surface_.mesh.area_normal(out[i]));
      is_small = area_m2 < below_m2;
      for_each_beside(out[i], [&](std::uint32_t t) {
        if (surface_.label[t] != surface_.label[seed] || fill_of_[t] == fills_) return;
        if (is_done(t)) is_small = false;  // only large regions are left before they are full
        fill_of_[t] = fills_, out.push_back(t);
      });
    }
    if (!is_small) out.clear();
    return out;
  }

 private:
  const Labelling& surface_;
  std::vector<std::uint32_t> twin_;     ///< [3T] kit::EdgeTable::twin
  std::vector<std::uint32_t> fill_of_;  ///< [T] number of a fill; 0: not done
  std::uint32_t fills_ = 0;
};

}  // namespace

DuePart::DuePart(const Labelling& whole, int rings) {
  const std::vector<std::uint8_t> near = near_due(whole, rings);
  std::vector<std::uint32_t> index(whole.mesh.positions.size(), kNoVertex);
  for (std::uint32_t t = 0; t < near.size(); ++t) {
    if (!near[t]) continue;
    Triangle triangle = whole.mesh.triangles[t];
    for (std::uint32_t& v : triangle) {
      if (index[v] == kNoVertex) {
        index[v] = static_cast<std::uint32_t>(vertex.size());
        vertex.push_back(v), labelling.mesh.positions.push_back(whole.mesh.positions[v]);
      }
      v = index[v];
    }
    labelling.mesh.triangles.push_back(triangle), labelling.origin.push_back(t);
    labelling.label.push_back(whole.label[t]), labelling.is_due.push_back(whole.is_due[t]);
  }
}

void DuePart::put_back(Labelling& whole) {
  const std::size_t first_cut = vertex.size();
  for (std::size_t i = 0; i < labelling.cut_edges.size(); ++i) {
    const auto& [a, b] = labelling.cut_edges[i];
    vertex.push_back(static_cast<std::uint32_t>(whole.mesh.positions.size()));
    whole.mesh.positions.push_back(labelling.mesh.positions[first_cut + i]);
    whole.cut_edges.push_back({vertex[a], vertex[b]});
  }
  Labelling out;
  const auto add = [&](const Triangle& triangle, int label, std::uint8_t is_due,
                       std::uint32_t origin) {
    out.mesh.triangles.push_back(triangle);
    out.label.push_back(label), out.is_due.push_back(is_due), out.origin.push_back(origin);
  };
  std::size_t p = 0;
  for (std::uint32_t t = 0; t < whole.mesh.triangles.size(); ++t) {
    if (p == labelling.origin.size() || labelling.origin[p] != t)
      add(whole.mesh.triangles[t], whole.label[t], whole.is_due[t], whole.origin[t]);
    for (; p < labelling.origin.size() && labelling.origin[p] == t; ++p) {
      const auto& [a, b, c] = labelling.mesh.triangles[p];
      add({vertex[a], vertex[b], vertex[c]}, labelling.label[p], labelling.is_due[p],
          whole.origin[t]);
    }
  }
  whole.mesh.triangles = std::move(out.mesh.triangles), whole.label = std::move(out.label);
  whole.is_due = std::move(out.is_due), whole.origin = std::move(out.origin);
}

bool mark_fragments(Labelling& surface, double least_m2) {
  const std::vector<std::uint8_t> was_due =
      std::exchange(surface.is_due, std::vector<std::uint8_t>(surface.label.size()));
  RegionFill fill(surface);
  bool any = false;
  for (std::uint32_t t = 0; t < was_due.size(); ++t) {
    if (!was_due[t]) continue;
    fill.for_each_beside(t, [&](std::uint32_t beside) {
      if (was_due[beside] || surface.label[beside] == Labelling::kNone || fill.is_done(beside))
        return;
      for (const std::uint32_t part : fill.region(beside, least_m2))
        surface.is_due[part] = 1, any = true;
    });
  }
  return any;
}

}  // namespace mr::atlas
