#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mr/core/ids.h"
#include "mr/core/vec.h"

namespace mr {

using Triangle = std::array<std::uint32_t, 3>;

/// The label of `count` triangles from `first` on.
template <typename Id>
struct Run {
  std::uint32_t first = 0, count = 0;
  Id id{0xFFFFFFFFu};  ///< kNoSensor, kNoView

  friend bool operator==(const Run&, const Run&) = default;
};
using SensorRun = Run<SensorId>;
using ViewRun = Run<ViewId>;

/// A triangle mesh as a plain value. Its triangles have labels of one kind at most: until the root
/// chooses views, who measured them, then what textures them. Runs are sorted by label and cover
/// [0, T).
struct Mesh {
  std::vector<Vec3f> positions;      ///< [V] metres, world frame
  std::vector<Triangle> triangles;   ///< [T] counter-clockwise seen from outside
  std::vector<SensorRun> sensors{};  ///< which sensor measured a triangle; empty: not told
  std::vector<ViewRun> views{};      ///< which view textures a triangle; empty: not chosen

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

/// One label per triangle, from the runs; kNoSensor, kNoView where there are none.
std::vector<SensorId> triangle_sensors(const Mesh& mesh);
std::vector<ViewId> triangle_views(const Mesh& mesh);

/// Sorts the triangles by label (stable), and sets the runs; those of the other kind go. [T].
void set_triangle_sensors(Mesh& mesh, const std::vector<SensorId>& sensors);
void set_triangle_views(Mesh& mesh, const std::vector<ViewId>& views);

/// The same label for all.
void set_sensor(Mesh& mesh, SensorId sensor);
void set_view(Mesh& mesh, ViewId view);
/// Takes the labels away; the triangles keep their order.
void clear_labels(Mesh& mesh);

/// The triangles of `mesh` for which `keep` is not 0, with their vertices in order of first use and
/// their labels. `keep`: [T].
Mesh select_triangles(const Mesh& mesh, const std::vector<std::uint8_t>& keep);

/// Adds `other` to `mesh`; nothing is welded; the triangles are sorted by label. Where one has
/// views and the other has sensors, the views are kept.
void append(Mesh& mesh, const Mesh& other);

/// Area in m².
double surface_area_m2(const Mesh& mesh);

}  // namespace mr
