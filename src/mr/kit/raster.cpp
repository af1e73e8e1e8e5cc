#include "mr/kit/raster.h"

#include <algorithm>
#include <numbers>
#include <vector>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"

namespace mr::kit {

Camera scaled(const Camera& camera, double factor) {
  Camera out = camera;
  out.width = static_cast<int>(camera.width * factor);
  out.height = static_cast<int>(camera.height * factor);
  out.fx *= factor, out.fy *= factor;
  out.cx = factor * (camera.cx + 0.5) - 0.5, out.cy = factor * (camera.cy + 0.5) - 0.5;
  return out;
}

Vec2d pixels_per_rad(const Camera& camera) {
  constexpr double kPi = std::numbers::pi;
  if (camera.model == CameraModel::pinhole) return {camera.fx, camera.fy};
  const double across = camera.width / (2 * kPi);
  if (camera.model == CameraModel::equirectangular) return {across, camera.height / kPi};
  const auto [low, high] =
      std::minmax_element(camera.beam_altitude_rad.begin(), camera.beam_altitude_rad.end());
  if (camera.height < 2 || !(*high > *low)) return {across, across};
  return {across, (camera.height - 1) / (*high - *low)};
}

std::array<CubeFace, 6> cube_faces(double focal_px, int ring_px) {
  CubeFace face;
  face.ring_px = ring_px;
  Camera& c = face.camera;
  c.fx = c.fy = focal_px;
  c.width = c.height = 2 * (static_cast<int>(std::ceil(focal_px)) + ring_px);
  c.cx = c.cy = 0.5 * (c.width - 1);
  std::array<CubeFace, 6> out;
  for (int i = 0; i < 6; ++i) {
    Vec3d forward, side;
    forward[i / 2] = i % 2 == 0 ? 1 : -1;
    side[(i / 2 + 1) % 3] = 1;
    const Vec3d down = cross(forward, side);
    for (int row = 0; row < 3; ++row) {
      face.R_camera_face(row, 0) = side[row];
      face.R_camera_face(row, 1) = down[row];
      face.R_camera_face(row, 2) = forward[row];
    }
    out[i] = face;
  }
  return out;
}

ScreenPolygon clip_to_screen(const Camera& camera, const std::array<Vec3d, 3>& corners) {
  ScreenPolygon out;
  for (int i = 0; i < 3; ++i) {
    const Vec3d a = corners[i], b = corners[(i + 1) % 3];
    if (a.z >= kNearPlane_m) out.points[out.count++] = to_screen(camera, a);
    if ((a.z >= kNearPlane_m) != (b.z >= kNearPlane_m))
      out.points[out.count++] =
          to_screen(camera, a + (b - a) * ((kNearPlane_m - a.z) / (b.z - a.z)));
  }
  return out;
}

Projection::Projection(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera)
    : in_camera(mesh.positions.size()), on_screen(mesh.positions.size()) {
  const Pose T_camera_world = T_world_camera.inverse();
  parallel_for(in_camera.size(), 2048, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      in_camera[v] = T_camera_world * vec_cast<double>(mesh.positions[v]);
      on_screen[v] = to_screen(camera, in_camera[v]);
    }
  });
}

ScreenPolygon Projection::polygon(const Camera& camera, const Triangle& t) const {
  const auto beyond = [&](std::uint32_t v) { return in_camera[v].z >= kNearPlane_m; };
  if (beyond(t[0]) && beyond(t[1]) && beyond(t[2]))
    return {{on_screen[t[0]], on_screen[t[1]], on_screen[t[2]], {}}, 3};
  return clip_to_screen(camera, {in_camera[t[0]], in_camera[t[1]], in_camera[t[2]]});
}

namespace {

/// Which rows of the picture a triangle touches.
struct Rows {
  float top = 0, bottom = -1;
};

std::vector<Rows> rows_of(const Mesh& mesh, const Camera& camera, const Projection& projection) {
  std::vector<Rows> rows(mesh.triangles.size());
  parallel_for(rows.size(), 2048, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const ScreenPolygon p = projection.polygon(camera, mesh.triangles[t]);
      if (p.count == 0) continue;
      const auto [top, bottom] =
          std::minmax_element(p.points.begin(), p.points.begin() + p.count,
                              [](const auto& a, const auto& b) { return a.v < b.v; });
      rows[t] = {std::floor(static_cast<float>(top->v)), std::ceil(static_cast<float>(bottom->v))};
    }
  });
  return rows;
}

/// Draws into pictures of the camera's size; `triangles` may be null.
void draw(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera, ImageDepth& depth,
          ImageId* triangles) {
  MR_ASSERT(camera.model == CameraModel::pinhole && camera.distortion == DistortionModel::none);
  const Projection projection(mesh, camera, T_world_camera);
  const std::vector<Rows> rows = rows_of(mesh, camera, projection);
  constexpr std::size_t kBand = 64;
  parallel_for((camera.height + kBand - 1) / kBand, 1, [&](std::size_t begin, std::size_t end) {
    const int first = static_cast<int>(begin * kBand);
    const int last = std::min(static_cast<int>(end * kBand), camera.height);
    for (std::uint32_t t = 0; t < rows.size(); ++t) {
      if (rows[t].bottom < static_cast<float>(first) || rows[t].top >= static_cast<float>(last))
        continue;
      const auto draw_depth = [&](const ScreenSpan& s) {
        float* const inv_depth = depth.row(s.y);
        for (int x = s.first; x <= s.last; ++x)
          inv_depth[x] =
              std::max(inv_depth[x], s.inv_z + static_cast<float>(x - s.first) * s.inv_z_step);
      };
      const auto draw_both = [&](const ScreenSpan& s) {
        float* const inv_depth = depth.row(s.y);
        std::uint32_t* const triangle = triangles->row(s.y);
        for (int x = s.first; x <= s.last; ++x) {
          const float inv_z = s.inv_z + static_cast<float>(x - s.first) * s.inv_z_step;
          const bool nearer = inv_z > inv_depth[x];
          inv_depth[x] = nearer ? inv_z : inv_depth[x];
          triangle[x] = nearer ? t : triangle[x];
        }
      };
      const ScreenPolygon polygon = projection.polygon(camera, mesh.triangles[t]);
      if (triangles)
        scan_polygon(polygon, camera.width, first, last, draw_both);
      else
        scan_polygon(polygon, camera.width, first, last, draw_depth);
    }
    for (int y = first; y < last; ++y)
      for (int x = 0; x < camera.width; ++x) {
        float& d = *depth.at(x, y);
        d = d > 0 ? 1 / d : 0;
      }
  });
}

}  // namespace

Raster rasterize(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera) {
  Raster out{ImageDepth(camera.width, camera.height),
             ImageId(camera.width, camera.height, kNoTriangle)};
  draw(mesh, camera, T_world_camera, out.depth, &out.triangle);
  return out;
}

void rasterize_part(const Mesh& mesh, const Camera& camera, const Projection& projection,
                    std::span<const std::uint32_t> triangles, DepthPart& part) {
  constexpr int kBand = 32;
  const int right = part.x + part.depth.width, below = part.y + part.depth.height;
  const auto bands = static_cast<std::size_t>((part.depth.height + kBand - 1) / kBand);
  // Triangles by band, in order; one that reaches into several is in each.
  std::vector<std::vector<std::uint32_t>> in_band(bands);
  for (const std::uint32_t t : triangles) {
    double top = below, bottom = -1, left = right, most = -1;
    const auto add = [&](const ScreenPoint& p) {
      top = std::min(top, p.v), bottom = std::max(bottom, p.v);
      left = std::min(left, p.u), most = std::max(most, p.u);
    };
    const Triangle& corners = mesh.triangles[t];
    const bool is_cut = std::ranges::any_of(
        corners, [&](std::uint32_t v) { return projection.in_camera[v].z < kNearPlane_m; });
    if (is_cut) {
      const ScreenPolygon p = projection.polygon(camera, corners);
      for (int i = 0; i < p.count; ++i) add(p.points[i]);
    } else {
      for (const std::uint32_t v : corners) add(projection.on_screen[v]);
    }
    const int first = ceil_within(top, part.y, below),
              last = floor_within(bottom, part.y - 1, below - 1);
    if (first > last ||
        ceil_within(left, part.x, right) > floor_within(most, part.x - 1, right - 1))
      continue;
    for (int band = (first - part.y) / kBand; band <= (last - part.y) / kBand; ++band)
      in_band[band].push_back(t);
  }
  parallel_for(bands, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t band = begin; band < end; ++band) {
      const int first = part.y + static_cast<int>(band) * kBand,
                end_row = std::min(first + kBand, below);
      for (const std::uint32_t t : in_band[band])
        scan_polygon(projection.polygon(camera, mesh.triangles[t]), right, first, end_row,
                     [&](const ScreenSpan& s) {
                       float* const inv_depth = part.depth.row(s.y - part.y);
                       for (int x = std::max(s.first, part.x); x <= s.last; ++x)
                         inv_depth[x - part.x] =
                             std::max(inv_depth[x - part.x],
                                      s.inv_z + static_cast<float>(x - s.first) * s.inv_z_step);
                     });
      for (int y = first; y < end_row; ++y)
        for (int x = 0; x < part.depth.width; ++x) {
          float& d = *part.depth.at(x, y - part.y);
          d = d > 0 ? 1 / d : 0;
        }
    }
  });
}

ImageDepth rasterize_depth(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera) {
  ImageDepth out(camera.width, camera.height);
  draw(mesh, camera, T_world_camera, out, nullptr);
  return out;
}

}  // namespace mr::kit
