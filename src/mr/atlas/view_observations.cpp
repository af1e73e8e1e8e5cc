#include "mr/atlas/view_observations.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mr/core/parallel.h"
#include "mr/kit/raster.h"
#include "mr/kit/srgb.h"

namespace mr::atlas {
namespace {

constexpr int kCoarse_px = 128;  // longer side of the coarse depth maps
constexpr float kSightMargin_m = 0.03f;
constexpr float kSightMargin_px = 3;  // coarse pixels: slopes below 60 degrees do not occlude
constexpr float kLeastGainFacing =
    0.5f;  // sine: below 30 degrees to the surface, specular light misleads
constexpr int kDarkest = 8, kBrightest = 247;  // beyond, a channel may be clipped

/// A low-resolution z-buffer of a pinhole camera.
class CoarseDepth {
 public:
  CoarseDepth(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera)
      : camera_(camera),
        T_camera_world_(T_world_camera.inverse()),
        inv_depth_(camera.width, camera.height) {
    for (int row = 0; row < 3; ++row)
      rotation_[row] = vec_cast<float>(T_camera_world_.rotation.row(row));
    translation_ = vec_cast<float>(T_camera_world_.translation);
    std::vector<std::uint32_t> next(mesh.positions.size());
    for (std::size_t v = 0; v < next.size(); ++v) next[v] = next_pixel(mesh.positions[v]);
    for (const Triangle& t : mesh.triangles) {
      // Skips triangles that cover no centre of a coarse pixel: most of them.
      const std::uint32_t differ = (next[t[0]] ^ next[t[1]]) | (next[t[0]] ^ next[t[2]]);
      if (!(differ & 0xFFFF) || !(differ >> 16)) continue;
      const auto corner = [&](int i) {
        return T_camera_world_ * vec_cast<double>(mesh.positions[t[i]]);
      };
      draw(kit::clip_to_screen(camera_, {corner(0), corner(1), corner(2)}));
    }
  }

  /// Whether a point is visible and not near a depth edge; nullopt outside the picture or within
  /// `ring_px` of its border.
  std::optional<bool> sees(Vec3f p_world, int ring_px) const {
    const OnScreen s = on_screen(p_world);
    const auto w = static_cast<float>(camera_.width), h = static_cast<float>(camera_.height);
    const float ring = static_cast<float>(ring_px) - 0.5f;
    if (!(s.z > 0 && s.u > ring && s.v > ring && s.u < w - 1 - ring && s.v < h - 1 - ring))
      return std::nullopt;
    const int x = static_cast<int>(s.u + 0.5f), y = static_cast<int>(s.v + 0.5f);
    const float margin = kSightMargin_m + kSightMargin_px * s.z / static_cast<float>(camera_.fx);
    const float farthest = 1 / (s.z + margin), nearest = 1 / std::max(s.z - margin, 1e-3f);
    for (int j = y - 1; j <= y + 1; ++j)
      for (int i = x - 1; i <= x + 1; ++i) {
        const float inv_z = *inv_depth_.at(i, j);
        if (inv_z < farthest || inv_z > nearest) return false;
      }
    return true;
  }

 private:
  struct OnScreen {
    float u = 0, v = 0, z = -1;  ///< z < 0: in front of the near plane
  };

  OnScreen on_screen(Vec3f p_world) const {
    const float z = dot(rotation_[2], p_world) + translation_.z;
    if (!(z >= static_cast<float>(kit::kNearPlane_m))) return {};
    const float x = dot(rotation_[0], p_world) + translation_.x;
    const float y = dot(rotation_[1], p_world) + translation_.y;
    return {static_cast<float>(camera_.fx) * x / z + static_cast<float>(camera_.cx),
            static_cast<float>(camera_.fy) * y / z + static_cast<float>(camera_.cy), z};
  }

  /// Column and row of the next pixel centre after a point, clamped to the picture. If two points
  /// have the same value, no pixel centre lies between them.
  std::uint32_t next_pixel(Vec3f p_world) const {
    const OnScreen s = on_screen(p_world);
    if (s.z < 0) return 0xFFFFFFFF;
    const auto next = [](float at, int count) {
      at = at > 0 ? std::min(at, static_cast<float>(count)) : 0;
      const auto whole = static_cast<std::uint32_t>(at);
      return whole + (static_cast<float>(whole) < at);
    };
    return next(s.u, camera_.width) << 16 | next(s.v, camera_.height);
  }

  void draw(const kit::ScreenPolygon& polygon) {
    kit::scan_polygon(polygon, camera_.width, 0, camera_.height, [&](const kit::ScreenSpan& s) {
      float* const row = inv_depth_.row(s.y);
      for (int x = s.first; x <= s.last; ++x)
        row[x] = std::max(row[x], s.inv_z + static_cast<float>(x - s.first) * s.inv_z_step);
    });
  }

  Camera camera_;
  Pose T_camera_world_;
  std::array<Vec3f, 3> rotation_;  ///< of T_camera_world_
  Vec3f translation_;
  Image<float, 1> inv_depth_;  ///< 0: nothing
};

/// The z-buffers of a view: one of a pinhole, six cube faces of a panorama.
class ViewDepth {
 public:
  ViewDepth(const Mesh& mesh, const View& view) {
    if (view.kind == View::Kind::pinhole) {
      faces_.emplace_back(mesh, coarse(view.camera()), view.T_world_camera);
      return;
    }
    ring_px_ = 2;
    for (const kit::CubeFace& face : kit::cube_faces(kCoarse_px / 2, ring_px_))
      faces_.emplace_back(mesh, face.camera, view.T_world_camera * Pose{face.R_camera_face, {}});
  }

  bool sees(Vec3f p_world) const {
    for (const CoarseDepth& face : faces_)
      if (const auto seen = face.sees(p_world, ring_px_)) return *seen;
    return false;
  }

 private:
  static Camera coarse(Camera camera) {
    const double scale =
        std::min(1.0, static_cast<double>(kCoarse_px) / std::max(camera.width, camera.height));
    camera.width = static_cast<int>(std::ceil(camera.width * scale));
    camera.height = static_cast<int>(std::ceil(camera.height * scale));
    camera.fx *= scale, camera.fy *= scale;
    camera.cx = (camera.cx + 0.5) * scale - 0.5, camera.cy = (camera.cy + 0.5) * scale - 0.5;
    return camera;
  }

  int ring_px_ = 1;
  std::vector<CoarseDepth> faces_;
};

/// Observes samples in one view.
class Observer {
 public:
  /// `valid`: null: all tiles are.
  Observer(const Mesh& mesh, const View& view, const PicturedView& shown, const TileMask* valid)
      : size_{view.width + 0.0f, view.height + 0.0f},
        shown_(shown),
        depth_(mesh, view),
        valid_(valid) {}

  std::optional<Observation> of(const Sample& sample) const {
    const float facing = shown_.facing(sample.p_world, sample.normal);
    if (!(facing >= kLeastGainFacing) || !depth_.sees(sample.p_world)) return std::nullopt;
    const auto pixel = shown_.pixel(sample.p_world);
    if (!pixel) return std::nullopt;
    const auto light = shown_.light(*pixel);
    const Vec2f place = shown_.place(*pixel);
    if (!light || !is_valid(place)) return std::nullopt;
    const Vec3f rgb = light->mean;
    return Observation{0,
                       facing,
                       std::sqrt(std::min({rgb.x, rgb.y, rgb.z})),
                       light->contrast,
                       light->slope,
                       place,
                       {std::log(rgb.x), std::log(rgb.y), std::log(rgb.z)}};
  }

 private:
  bool is_valid(Vec2f place) const {
    if (!valid_) return true;
    const auto tile = [&](float at) { return static_cast<int>(at) / valid_->tile_px; };
    const int column = tile(place.x * size_.x), row = tile(place.y * size_.y);
    return column < valid_->columns && row < valid_->rows && valid_->at(column, row);
  }

  Vec2f size_;  ///< of the camera's picture, pixels
  PicturedView shown_;
  ViewDepth depth_;
  const TileMask* valid_;
};

}  // namespace

std::optional<PicturedView> PicturedView::find(const View& view, const Pictures& pictures) {
  const auto found = pictures.find(view.stream);
  if (found == pictures.end() || !found->second) return std::nullopt;
  const ImageRgb& p = *found->second;
  const Rect& r = view.atlas_rect;
  if (view.image_rect.empty() || r.empty() || r.x < 0 || r.y < 0 || r.width > p.width - r.x ||
      r.height > p.height - r.y)
    return std::nullopt;
  return PicturedView(view, p);
}

float PicturedView::facing(Vec3f p_world, Vec3f normal) const {
  return dot(normal, normalized(vec_cast<float>(view_->T_world_camera.translation) - p_world));
}

std::optional<Vec2d> PicturedView::pixel(Vec3f p_world) const {
  const auto at = project(camera_, T_camera_world_ * vec_cast<double>(p_world));
  const Rect &from = view_->image_rect, &to = view_->atlas_rect;
  if (!at || !(at->x >= from.x && at->y >= from.y && at->x <= from.x + from.width - 1 &&
               at->y <= from.y + from.height - 1))
    return std::nullopt;
  return Vec2d{(at->x + 0.5 - from.x) * to.width / from.width + to.x - 0.5,
               (at->y + 0.5 - from.y) * to.height / from.height + to.y - 0.5};
}

std::array<std::uint8_t, 3> PicturedView::color(Vec2d pixel) const {
  return sample_bilinear(*picture_, view_->atlas_rect, pixel.x, pixel.y);
}

int PicturedView::contrast(Vec2d pixel) const {
  const Rect& r = view_->atlas_rect;
  const int x = static_cast<int>(std::lround(pixel.x)), y = static_cast<int>(std::lround(pixel.y));
  std::array<std::uint8_t, 3> low{255, 255, 255}, high{};
  for (int j = std::max(r.y, y - 2); j <= std::min(r.y + r.height - 1, y + 2); ++j)
    for (int i = std::max(r.x, x - 2); i <= std::min(r.x + r.width - 1, x + 2); ++i)
      for (int c = 0; c < 3; ++c) {
        low[c] = std::min(low[c], picture_->at(i, j)[c]);
        high[c] = std::max(high[c], picture_->at(i, j)[c]);
      }
  return std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
}

Vec2f PicturedView::place(Vec2d pixel) const {
  const Rect &from = view_->image_rect, &to = view_->atlas_rect;
  const double x = (pixel.x + 0.5 - to.x) * from.width / to.width + from.x;
  const double y = (pixel.y + 0.5 - to.y) * from.height / to.height + from.y;
  return {static_cast<float>(x / view_->width), static_cast<float>(y / view_->height)};
}

std::optional<PicturedView::Light> PicturedView::light(Vec2d pixel) const {
  constexpr int kReach = 2;  // steps
  const Rect& r = view_->atlas_rect;
  const int step = std::max(1, r.width / 640);
  const int x = static_cast<int>(std::lround(pixel.x)), y = static_cast<int>(std::lround(pixel.y));
  const int margin = kReach * step + static_cast<int>(std::ceil(view_->gutter_px));
  if (x - margin < r.x || y - margin < r.y || x + margin >= r.x + r.width ||
      y + margin >= r.y + r.height)
    return std::nullopt;
  Vec3f sum;
  float squares = 0;
  for (int j = -kReach; j <= kReach; ++j)
    for (int i = -kReach; i <= kReach; ++i) {
      const std::uint8_t* const p = picture_->at(x + i * step, y + j * step);
      if (std::min({p[0], p[1], p[2]}) < kDarkest || std::max({p[0], p[1], p[2]}) > kBrightest)
        return std::nullopt;
      const Vec3f light{kit::to_linear(p[0]), kit::to_linear(p[1]), kit::to_linear(p[2])};
      sum += light, squares += light.y * light.y;
    }
  constexpr float kCount = (2 * kReach + 1) * (2 * kReach + 1);
  const Vec3f mean = sum / kCount;
  const float contrast = std::sqrt(std::max(0.0f, squares / kCount - mean.y * mean.y)) / mean.y;
  // Of a ramp: the deviation of -2..2 steps is the square root of 2.
  const float steps =
      static_cast<float>(step * view_->image_rect.width) / static_cast<float>(r.width);
  return Light{mean, contrast, contrast / (std::sqrt(2.0f) * steps)};
}

std::vector<Sample> spread_samples(const Mesh& mesh, std::size_t count) {
  std::vector<double> area_up_to(mesh.triangles.size());
  parallel_for(area_up_to.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const float area = length(mesh.area_normal(t));
      area_up_to[t] = std::isfinite(area) ? area : 0;
    }
  });
  std::partial_sum(area_up_to.begin(), area_up_to.end(), area_up_to.begin());
  std::vector<Sample> out;
  if (area_up_to.empty() || !(area_up_to.back() > 0)) return out;
  std::size_t t = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double wanted = (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    while (t + 1 < area_up_to.size() && area_up_to[t] < wanted * area_up_to.back()) ++t;
    // The R2 low-discrepancy sequence, folded into the triangle.
    const double n = static_cast<double>(i + 1);
    double b = n * 0.7548776662466927, c = n * 0.5698402909980532;
    b -= std::floor(b), c -= std::floor(c);
    if (b + c > 1) b = 1 - b, c = 1 - c;
    const Vec3f a = mesh.corner(t, 0);
    const Vec3f p = a + (mesh.corner(t, 1) - a) * static_cast<float>(b) +
                    (mesh.corner(t, 2) - a) * static_cast<float>(c);
    out.push_back({p, normalized(mesh.area_normal(t))});
  }
  return out;
}

std::vector<std::vector<Observation>> observe(std::span<const Sample> samples, const Mesh& mesh,
                                              std::span<const View> views, const Pictures& pictures,
                                              const ValidTiles& valid) {
  std::vector<std::optional<Observer>> observers(views.size());
  parallel_for(views.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const auto mask = valid.find(views[v].id);
      if (const auto shown = PicturedView::find(views[v], pictures))
        observers[v].emplace(mesh, views[v], *shown, mask == valid.end() ? nullptr : &mask->second);
    }
  });
  std::vector<std::vector<Observation>> out(samples.size());
  parallel_for(samples.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t v = 0; v < views.size(); ++v)
        if (auto seen = observers[v] ? observers[v]->of(samples[i]) : std::nullopt) {
          seen->view = v;
          out[i].push_back(*seen);
        }
  });
  return out;
}

}  // namespace mr::atlas
