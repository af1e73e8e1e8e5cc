#include "mr/merge/overlap/part_view.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mr/core/assert.h"
#include "mr/core/image.h"
#include "mr/kit/raster.h"
#include "mr/kit/raycast.h"

namespace mr::merge {
namespace {

constexpr float kSameFacing = 0.25f;  // cosine: near creases normals differ, those of a board's
                                      // two sides still more
constexpr float kSlack = 1e-3f;       // rounding leaves no pixel between two triangles
constexpr float kOblique = 4;         // of the range: the farthest along the ray
constexpr float kMeetFacing = 0.85f;  // cosine, of surfaces that are averaged
constexpr float kStillThere = 2;      // times the range: what was lost to a surface that a third
                                      // one took lies farther from that one
constexpr int kMostAside = 3;         // pixels
constexpr int kAmid = 2;              // pixels from a border: the surface goes on all around
constexpr int kMostInner = 64;        // pixels: farther from a border is as good
constexpr float kJump = 0.04f;        // relative step of depth at a border

struct ScreenVertex {
  float u = 0, v = 0, inv_z = 0;  // inv_z 0: before the near plane
};

/// Bounding rectangle of a part in a picture.
struct Extent {
  float left = 1e9f, top = 1e9f, right = -1e9f, bottom = -1e9f;

  void add(const ScreenVertex& p) {
    left = std::min(left, p.u), right = std::max(right, p.u);
    top = std::min(top, p.v), bottom = std::max(bottom, p.v);
  }
  /// With a pixel around it, but at most `margin` pixels outside of the camera's picture.
  Rect within(const Camera& camera, int margin) const {
    const auto limited = [&](float at, int size) {
      return static_cast<int>(std::clamp(std::floor(at), static_cast<float>(-margin),
                                         static_cast<float>(size + margin)));
    };
    const int x = limited(left - 1, camera.width), y = limited(top - 1, camera.height);
    return {x, y, std::max(limited(right + 3, camera.width) - x, 0),
            std::max(limited(bottom + 3, camera.height) - y, 0)};
  }
};

/// The z-buffer and ID buffer while they are rasterized. 1 / depth is linear in the picture.
/// A piece of the picture, in the whole picture's coordinates: rounding does not depend on the
/// piece.
struct Canvas {
  int x_first, y_first, width, height;
  std::vector<std::uint32_t>& triangle;
  std::vector<float> inv_z;

  void draw(const ScreenVertex& a, const ScreenVertex& b, const ScreenVertex& c, std::uint32_t id) {
    const float area = (b.u - a.u) * (c.v - a.v) - (c.u - a.u) * (b.v - a.v);
    if (!(area < 0)) return;  // rows go down: a triangle that faces the camera turns this way
    const auto first = [](float low, int least) {
      return std::max(static_cast<int>(std::ceil(low)), least);
    };
    const int x_last = x_first + width - 1, y_last = y_first + height - 1;
    const float left = std::min({a.u, b.u, c.u}), right = std::max({a.u, b.u, c.u});
    const float top = std::min({a.v, b.v, c.v}), bottom = std::max({a.v, b.v, c.v});
    if (!(right >= static_cast<float>(x_first) && bottom >= static_cast<float>(y_first) &&
          left <= static_cast<float>(x_last) && top <= static_cast<float>(y_last)))
      return;
    const int x0 = first(left, x_first), y0 = first(top, y_first);
    const int x1 = static_cast<int>(std::floor(std::min(right, static_cast<float>(x_last))));
    const int y1 = static_cast<int>(std::floor(std::min(bottom, static_cast<float>(y_last))));
    if (x0 > x1 || y0 > y1) return;
    // Barycentric weights of b and c, and 1 / depth, as planes over the picture.
    const float scale = 1 / area;
    const float wb_u = (c.v - a.v) * scale, wb_v = -(c.u - a.u) * scale;
    const float wc_u = -(b.v - a.v) * scale, wc_v = (b.u - a.u) * scale;
    const float db = b.inv_z - a.inv_z, dc = c.inv_z - a.inv_z;
    for (int y = y0; y <= y1; ++y) {
      const float dv = static_cast<float>(y) - a.v;
      for (int x = x0; x <= x1; ++x) {
        const float du = static_cast<float>(x) - a.u;
        const float wb = wb_u * du + wb_v * dv, wc = wc_u * du + wc_v * dv;
        if (wb < -kSlack || wc < -kSlack || wb + wc > 1 + kSlack) continue;
        const float nearness = a.inv_z + wb * db + wc * dc;
        const std::size_t pixel = static_cast<std::size_t>(y - y_first) * width + (x - x_first);
        if (nearness <= inv_z[pixel]) continue;
        inv_z[pixel] = nearness, triangle[pixel] = id;
      }
    }
  }
};

}  // namespace

PartView::PartView(const kit::Part& part, const Measured& measured, const Region& region,
                   std::uint32_t source, const Camera& camera, const Pose& T_world_camera,
                   int margin_px, double feather_m)
    : measured_(&measured),
      region_(region),
      precision_(part.sources[source].precision),
      feather_m_(static_cast<float>(feather_m)) {
  MR_ASSERT(camera.model == CameraModel::pinhole && camera.distortion == DistortionModel::none);
  const Mat3& axes = T_world_camera.rotation;
  origin_ = vec_cast<float>(T_world_camera.translation);
  forward_ = vec_cast<float>(axes.column(2));
  focal_px_ = static_cast<float>(camera.fx);
  right_ = vec_cast<float>(axes.column(0) * camera.fx + axes.column(2) * camera.cx);
  down_ = vec_cast<float>(axes.column(1) * camera.fy + axes.column(2) * camera.cy);

  const Mesh& mesh = region.mesh;
  std::vector<ScreenVertex> screen(mesh.positions.size());
  Extent extent;
  for (std::size_t v = 0; v < screen.size(); ++v) {
    const Vec3f d = mesh.positions[v] - origin_;
    const float z = dot(forward_, d), inv_z = 1 / z;
    if (!(z >= static_cast<float>(kit::kNearPlane_m))) continue;
    screen[v] = {dot(right_, d) * inv_z, dot(down_, d) * inv_z, inv_z};
    extent.add(screen[v]);
  }
  const auto [left, top, width, height] = extent.within(camera, margin_px);
  width_ = width, height_ = height;
  left_ = left, top_ = top;
  triangle_.assign(static_cast<std::size_t>(width_) * height_, kit::kNoTriangle);
  Canvas canvas{left, top, width_, height_, triangle_, std::vector<float>(triangle_.size(), 0.0f)};
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (const std::uint32_t label = measured.label[region.parent[t]];
        label != source && label != Measured::kNoSource)
      continue;
    const auto& [i, j, k] = mesh.triangles[t];
    const ScreenVertex &a = screen[i], &b = screen[j], &c = screen[k];
    if (a.inv_z > 0 && b.inv_z > 0 && c.inv_z > 0) canvas.draw(a, b, c, t);
  }
  find_inner(canvas.inv_z);
  widen();
}

/// Distances to borders by city blocks: forwards, then backwards.
void PartView::find_inner(const std::vector<float>& inv_z) {
  inner_.assign(triangle_.size(), 0);
  const auto goes_on = [&](std::size_t i, std::size_t k) {
    return triangle_[k] != kit::kNoTriangle &&
           std::abs(inv_z[i] - inv_z[k]) < kJump * std::min(inv_z[i], inv_z[k]);
  };
  const auto step = [&](int x, int y, int back) {
    const std::size_t i = static_cast<std::size_t>(y) * width_ + x;
    if (triangle_[i] == kit::kNoTriangle) return;
    const auto from = [&](bool inside, std::size_t k) {
      return inside && goes_on(i, k) ? std::min<int>(inner_[k] + 1, kMostInner) : 1;
    };
    const std::size_t w = static_cast<std::size_t>(width_);
    const int beside = back ? from(x + 1 < width_, i + 1) : from(x > 0, i - 1);
    const int above = back ? from(y + 1 < height_, i + w) : from(y > 0, i - w);
    const int least = std::min(beside, above);
    inner_[i] = static_cast<std::uint8_t>(back ? std::min<int>(inner_[i], least) : least);
  };
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) step(x, y, 0);
  for (int y = height_ - 1; y >= 0; --y)
    for (int x = width_ - 1; x >= 0; --x) step(x, y, 1);
}

/// Dilates surfaces by a pixel, so that rounding leaves no gap where two parts end at one line.
void PartView::widen() {
  const std::vector<std::uint32_t> drawn = triangle_;
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * width_ + x;
      if (drawn[i] != kit::kNoTriangle) continue;
      const auto take = [&](bool inside, std::size_t k) {
        if (inside && triangle_[i] == kit::kNoTriangle) triangle_[i] = drawn[k];
      };
      take(x > 0, i - 1), take(x + 1 < width_, i + 1);
      take(y > 0, i - width_), take(y + 1 < height_, i + width_);
    }
}

PartView::Seen PartView::seen(const SurfacePoint& point) const {
  const Vec3f d = point.position - origin_;
  const float z = dot(forward_, d);
  if (!(z >= static_cast<float>(kit::kNearPlane_m))) return {};
  const float inv_z = 1 / z;
  const float u = dot(right_, d) * inv_z + 0.5f, v = dot(down_, d) * inv_z + 0.5f;
  if (!(u >= static_cast<float>(left_) && v >= static_cast<float>(top_) &&
        u < static_cast<float>(left_ + width_) && v < static_cast<float>(top_ + height_)))
    return {};
  return {static_cast<int>(std::floor(u)) - left_, static_cast<int>(std::floor(v)) - top_, z, d};
}

std::uint32_t PartView::triangle(int x, int y) const {
  if (x < 0 || y < 0 || x >= width_ || y >= height_) return kit::kNoTriangle;
  return triangle_[static_cast<std::size_t>(y) * width_ + x];
}

/// How far from a triangle's plane a point may lie on its surface; 0: it faces another way.
float PartView::range_m(std::uint32_t t, const Seen& seen, const SurfacePoint& point,
                        float slack_m) const {
  const Vec3f normal = measured_->plane[region_.parent[t]].normal;
  if (dot(normal, point.normal) < kSameFacing) return 0;
  const auto sigma = static_cast<float>(precision_.sigma_m(seen.z));
  const float range = 2 * std::max(sigma, point.sigma_m) + slack_m + measured_->slack_m;
  const float slope = std::abs(dot(normal, seen.ray)) / length(seen.ray);  // cosine to the ray
  return range * std::min(1.0f, kOblique * slope);
}

/// Whether a triangle's plane is the surface that a point lies on.
bool PartView::is_alike(std::uint32_t t, const Seen& seen, const SurfacePoint& point, float slack_m,
                        float times) const {
  if (t == kit::kNoTriangle) return false;
  const float range = times * range_m(t, seen, point, slack_m);
  return range > 0 && std::abs(measured_->plane[region_.parent[t]].above(point.position)) <= range;
}

/// Pixels to the next border.
int PartView::inner(const Seen& at) const {
  return inner_[static_cast<std::size_t>(at.y) * width_ + at.x];
}

float PartView::weight(const Seen& at, std::uint32_t t) const {
  const float to_border_m = static_cast<float>(inner(at)) * at.z / focal_px_;
  const float quality = measured_->quality[region_.parent[t]];
  return std::min(to_border_m / feather_m_, 1.0f) * quality * quality;
}

float PartView::own_weight(const SurfacePoint& point) const {
  const Seen at = seen(point);
  if (!(at.z > 0)) return 0;
  const std::uint32_t t = triangle(at.x, at.y);
  return t == kit::kNoTriangle || !is_alike(t, at, point, 0, 1) ? 0 : weight(at, t);
}

PartView::Meeting PartView::meeting(const SurfacePoint& point, float slack_m) const {
  const Seen at = seen(point);
  if (!(at.z > 0)) return {};
  const std::uint32_t t = triangle(at.x, at.y);
  if (t == kit::kNoTriangle) return {};
  if (dot(measured_->plane[region_.parent[t]].normal, point.normal) < kMeetFacing) return {};
  const float along_m = dot(point.normal, nearest_on(t, point) - point.position);
  const float off = along_m / range_m(t, at, point, slack_m);
  if (!(std::abs(off) < 1)) return {};
  return {along_m, (1 - off * off) * weight(at, t)};
}

/// The point of a triangle that is nearest to another.
Vec3f PartView::nearest_on(std::uint32_t t, const SurfacePoint& point) const {
  const auto corner = [&](int i) { return vec_cast<double>(region_.mesh.corner(t, i)); };
  return vec_cast<float>(
      kit::nearest_on_triangle(vec_cast<double>(point.position), corner(0), corner(1), corner(2)));
}

bool PartView::has(const SurfacePoint& point, float slack_m) const {
  const Seen at = seen(point);
  return at.z > 0 && is_alike(triangle(at.x, at.y), at, point, slack_m, 1);
}

bool PartView::reaches(const SurfacePoint& point, float slack_m, float aside_m) const {
  const Seen at = seen(point);
  if (!(at.z > 0)) return false;
  const auto is_there = [&](std::uint32_t t) {
    return is_alike(t, at, point, slack_m, kStillThere);
  };
  if (inner(at) >= kAmid && is_there(triangle(at.x, at.y))) return true;
  const auto is_near = [&](std::uint32_t t) {
    if (!is_there(t)) return false;
    const Vec3f off = point.position - nearest_on(t, point);
    const Vec3f normal = measured_->plane[region_.parent[t]].normal;
    return length(off - normal * dot(normal, off)) <= aside_m;
  };
  const int aside_px =
      std::clamp(static_cast<int>(std::ceil(aside_m * focal_px_ / at.z)), 1, kMostAside);
  for (int ring = 0; ring <= aside_px; ++ring)  // the nearest pixels first
    for (int dy = -ring; dy <= ring; ++dy)
      for (int dx = -ring; dx <= ring; dx += std::abs(dy) == ring || ring == 0 ? 1 : 2 * ring)
        if (is_near(triangle(at.x + dx, at.y + dy))) return true;
  return false;
}

}  // namespace mr::merge
