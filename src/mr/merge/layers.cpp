#include "mr/merge/layers.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "mr/core/assert.h"
#include "mr/core/image.h"
#include "mr/kit/raster.h"

namespace mr::merge {
namespace {

/// Corners lie on a lattice of 1/256 pixel: then lines between them are exact, and a pixel on an
/// edge that two triangles share belongs to one of them.
constexpr int kLattice = 256;

/// A place in the picture, in 1/256 pixel.
struct Corner {
  std::int32_t u = 0, v = 0;
};
constexpr std::int32_t kTooNear = std::numeric_limits<std::int32_t>::min();  // as u

int floor_pixel(std::int32_t lattice) { return lattice >> 8; }
int ceil_pixel(std::int32_t lattice) { return (lattice + kLattice - 1) >> 8; }

Corner on_lattice(const kit::ScreenPoint& p) {
  constexpr double kFarOut = 1 << 20;  // pixels
  const auto nearest = [=](double x) {
    return static_cast<std::int32_t>(std::lrint(std::clamp(x, -kFarOut, kFarOut) * kLattice));
  };
  return {nearest(p.u), nearest(p.v)};
}

/// Pixels from first to last of a row.
struct Columns {
  int first, last;
};

/// A line with the triangle on its positive side.
struct Line {
  double at_origin, per_x, per_y;

  Line(Corner p, Corner q) {
    per_x = p.v - q.v, per_y = q.u - p.u;
    at_origin = -(per_x * p.u + per_y * p.v) / kLattice;
    // A point on the line is on the positive side of this direction or of the reverse.
    if (per_x < 0 || (per_x == 0 && per_y < 0)) at_origin -= 1.0 / kLattice;
  }

  /// Leaves the columns of row `y` that are on the positive side.
  void cut(Columns& c, int y) const {
    const double at_zero = at_origin + per_y * y;
    if (per_x == 0) {
      if (at_zero < 0) c.last = -1;
      return;
    }
    const double x = std::clamp(-at_zero / per_x, -1e6, 1e6);
    const int whole = static_cast<int>(x);
    if (per_x > 0)
      c.first = std::max(c.first, whole + (x > whole));
    else
      c.last = std::min(c.last, whole - (x < whole));
  }
};

/// The pixels that a triangle may cover, last included.
struct Bounds {
  Columns columns;
  int top, bottom;

  Bounds(Corner a, Corner b, Corner c, const Camera& camera)
      : columns{std::max(ceil_pixel(std::min({a.u, b.u, c.u})), 0),
                std::min(floor_pixel(std::max({a.u, b.u, c.u})), camera.width - 1)},
        top(std::max(ceil_pixel(std::min({a.v, b.v, c.v})), 0)),
        bottom(std::min(floor_pixel(std::max({a.v, b.v, c.v})), camera.height - 1)) {}
  bool empty() const { return columns.first > columns.last || top > bottom; }
};

/// Which pixels are to be drawn, also by tiles of 8x8, so that triangles elsewhere are passed over.
class Mask {
 public:
  Mask(int width, int height) : pixels_(width, height), tiles_(tile(width) + 1, tile(height) + 1) {}

  void mark(int y, Columns columns) {
    std::fill(pixels_.at(columns.first, y), pixels_.at(columns.last, y) + 1, std::uint8_t{1});
    for (int x = tile(columns.first); x <= tile(columns.last); ++x) *tiles_.at(x, tile(y)) = 1;
  }
  bool marked(int x, int y) const { return *pixels_.at(x, y) != 0; }
  bool any_near(const Bounds& b) const {
    for (int y = tile(b.top); y <= tile(b.bottom); ++y)
      for (int x = tile(b.columns.first); x <= tile(b.columns.last); ++x)
        if (*tiles_.at(x, y)) return true;
    return false;
  }

 private:
  static int tile(int pixel) { return pixel / 8; }

  ImageMask pixels_, tiles_;
};

/// A mesh in a camera's picture.
struct Projection {
  const Mesh& mesh;
  const Camera& camera;
  std::vector<Vec3d> points;    // [V] camera frame
  std::vector<Corner> corners;  // [V] kTooNear before the near plane
};

Projection projected(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera) {
  MR_ASSERT(camera.model == CameraModel::pinhole && camera.distortion == DistortionModel::none);
  Projection out{mesh, camera, {}, {}};
  out.points.reserve(mesh.positions.size()), out.corners.reserve(mesh.positions.size());
  const Pose T_camera_world = T_world_camera.inverse();
  for (const Vec3f position : mesh.positions) {
    const Vec3d p = T_camera_world * vec_cast<double>(position);
    out.points.push_back(p);
    out.corners.push_back(p.z >= kit::kNearPlane_m ? on_lattice(kit::to_screen(camera, p))
                                                   : Corner{kTooNear, 0});
  }
  return out;
}

/// Calls row(y, columns) for the pixels inside a triangle, if it is wound the positive way and
/// wanted(bounds).
template <typename Wanted, typename Row>
void scan(Corner a, Corner b, Corner c, const Camera& camera, Wanted&& wanted, Row&& row) {
  const auto times = [](std::int32_t x, std::int32_t y) {
    return static_cast<std::int64_t>(x) * y;
  };
  if (times(b.u - a.u, c.v - a.v) <= times(c.u - a.u, b.v - a.v)) return;
  const Bounds bounds(a, b, c, camera);
  if (bounds.empty() || !wanted(bounds)) return;
  const Line ab(a, b), bc(b, c), ca(c, a);
  for (int y = bounds.top; y <= bounds.bottom; ++y) {
    Columns inside = bounds.columns;
    ab.cut(inside, y), bc.cut(inside, y), ca.cut(inside, y);
    if (inside.first <= inside.last) row(y, inside);
  }
}

/// The same for a triangle of a mesh that faces the camera.
template <typename Wanted, typename Row>
void scan(const Projection& p, std::uint32_t triangle, Wanted&& wanted, Row&& row) {
  const auto [i, j, k] = p.mesh.triangles[triangle];
  const Corner a = p.corners[i], b = p.corners[k], c = p.corners[j];
  if (a.u != kTooNear && b.u != kTooNear && c.u != kTooNear)
    return scan(a, b, c, p.camera, wanted, row);
  const kit::ScreenPolygon polygon =
      kit::clip_to_screen(p.camera, {p.points[i], p.points[k], p.points[j]});
  const auto corner = [&](int m) { return on_lattice(polygon.points[m]); };
  for (int m = 2; m < polygon.count; ++m)
    scan(corner(0), corner(m - 1), corner(m), p.camera, wanted, row);
}

/// The depth of a triangle over the picture.
struct DepthPlane {
  double at_origin, per_x, per_y;  // 1 / depth is linear
  double nearest, farthest;

  DepthPlane(const Projection& p, std::uint32_t triangle) {
    const auto [i, j, k] = p.mesh.triangles[triangle];
    const Vec3d &a = p.points[i], &b = p.points[j], &c = p.points[k], n = cross(b - a, c - a);
    nearest = std::max(std::min({a.z, b.z, c.z}), kit::kNearPlane_m);
    farthest = std::max({a.z, b.z, c.z});
    const double scale = 1 / dot(n, a);
    per_x = scale * n.x / p.camera.fx, per_y = scale * n.y / p.camera.fy;
    at_origin = scale * n.z - per_x * p.camera.cx - per_y * p.camera.cy;
  }
  float operator()(int x, int y) const {
    const double depth = 1 / (at_origin + per_x * x + per_y * y);
    return static_cast<float>(depth > nearest ? std::min(depth, farthest) : nearest);
  }
};

Mask pixels_of(const Projection& p, const std::vector<std::uint8_t>& flagged) {
  Mask mask(p.camera.width, p.camera.height);
  for (std::uint32_t t = 0; t < flagged.size(); ++t)
    if (flagged[t])
      scan(
          p, t, [](const Bounds&) { return true; },
          [&](int y, Columns columns) { mask.mark(y, columns); });
  return mask;
}

/// A picture without anything in it.
Layers no_layers(const Camera& camera, const Pose& T_world_camera) {
  const Mat3& axes = T_world_camera.rotation;
  Layers out;
  out.width = camera.width, out.height = camera.height;
  out.origin = vec_cast<float>(T_world_camera.translation);
  out.corner = vec_cast<float>(axes * unproject(camera, {0, 0}));
  out.right = vec_cast<float>(axes.column(0) / camera.fx);
  out.down = vec_cast<float>(axes.column(1) / camera.fy);
  out.first.assign(static_cast<std::size_t>(camera.width) * camera.height + 1, 0);
  return out;
}

}  // namespace

Layers draw_layers(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera,
                   const std::vector<std::uint8_t>* flagged) {
  struct Drawn {
    std::uint32_t pixel, triangle;
    float depth_m;
  };
  const Projection projection = projected(mesh, camera, T_world_camera);
  std::optional<Mask> mask;
  if (flagged) mask = pixels_of(projection, *flagged);
  Layers out = no_layers(camera, T_world_camera);
  std::vector<Drawn> drawn;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    std::optional<DepthPlane> depth;
    scan(
        projection, t, [&](const Bounds& b) { return !mask || mask->any_near(b); },
        [&](int y, Columns columns) {
          for (int x = columns.first; x <= columns.last; ++x) {
            if (mask && !mask->marked(x, y)) continue;
            if (!depth) depth.emplace(projection, t);
            const auto pixel = static_cast<std::uint32_t>(y * camera.width + x);
            drawn.push_back({pixel, t, (*depth)(x, y)});
            ++out.first[pixel + 1];
          }
        });
  }
  std::partial_sum(out.first.begin(), out.first.end(), out.first.begin());
  out.fragments.resize(drawn.size());
  std::vector<std::uint32_t> end(out.first.begin(), out.first.end() - 1);
  for (const Drawn& d : drawn) {  // insertion by depth, behind its equals
    std::uint32_t place = end[d.pixel]++;
    for (; place > out.first[d.pixel] && out.fragments[place - 1].depth_m > d.depth_m; --place)
      out.fragments[place] = out.fragments[place - 1];
    out.fragments[place] = {d.triangle, d.depth_m, false};
  }
  return out;
}

Camera scaled(const Camera& camera, double factor) {
  Camera out = camera;
  out.width = static_cast<int>(camera.width * factor);
  out.height = static_cast<int>(camera.height * factor);
  out.fx *= factor, out.fy *= factor;
  out.cx = factor * (camera.cx + 0.5) - 0.5, out.cy = factor * (camera.cy + 0.5) - 0.5;
  return out;
}

}  // namespace mr::merge
