#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mr/core/vec.h"

namespace mr {

/// Scene-wide number of a view: the index of its sensor in the scene file.
using ViewId = std::uint32_t;

/// A triangle that no view textures; drawn in a neutral colour.
inline constexpr ViewId kNoView = 0xFFFFFFFFu;

using Triangle = std::array<std::uint32_t, 3>;

/// `count` triangles from `first` on are textured by `view`.
struct ViewRun {
  std::uint32_t first = 0, count = 0;
  ViewId view = kNoView;

  friend bool operator==(const ViewRun&, const ViewRun&) = default;
};

/// A triangle mesh as a plain value.
struct Mesh {
  std::vector<Vec3f> positions;     ///< [V] metres, world frame
  std::vector<Triangle> triangles;  ///< [T] counter-clockwise seen from outside
  std::vector<ViewRun> runs;        ///< sorted by view, covers [0, T); empty: not labelled yet

  bool empty() const { return triangles.empty(); }
  friend bool operator==(const Mesh&, const Mesh&) = default;

  Vec3f corner(std::size_t triangle, int i) const { return positions[triangles[triangle][i]]; }
  /// Twice the triangle's area along its normal.
  Vec3f area_normal(std::size_t triangle) const {
    const Vec3f a = corner(triangle, 0);
    return cross(corner(triangle, 1) - a, corner(triangle, 2) - a);
  }
  Vec3f centroid(std::size_t triangle) const {
    return (corner(triangle, 0) + corner(triangle, 1) + corner(triangle, 2)) / 3.0f;
  }
};

/// One view per triangle, from the runs; kNoView where there are none.
std::vector<ViewId> triangle_views(const Mesh& mesh);

/// Sorts the triangles by view (stable) and sets the runs. `views`: [T].
void set_triangle_views(Mesh& mesh, const std::vector<ViewId>& views);

/// The triangles of `mesh` for which `keep` is not 0, with their vertices in order of first use and
/// their views. `keep`: [T].
Mesh select_triangles(const Mesh& mesh, const std::vector<std::uint8_t>& keep);

/// Adds `other` to `mesh`; nothing is welded; views are kept.
void append(Mesh& mesh, const Mesh& other);

/// Area in m².
double surface_area_m2(const Mesh& mesh);

}  // namespace mr
