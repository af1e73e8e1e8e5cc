#include "mr/atlas/view_blend.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "mr/core/parallel.h"

namespace mr::atlas {
namespace {

constexpr int kBlendBlock_px = 4;                        // of the coarse depth maps, and of normals
constexpr float kFront_m = 0.03f, kFront_share = 0.01f;  // nearer surface hides a point
constexpr float kSteepest = 3;    // depth over width of surface that does not hide itself
constexpr float kBorder_px = 40;  // of a picture of 640 columns; weights fall towards its border
constexpr float kLeast = 0.02f;   // weight of a picture in its own tile
constexpr float kNearWhiteWeight = 0.25f;
constexpr int kNearWhite = 250;

/// The least depth of each block of pixels and of those up to `reach` blocks away; nothing counts
/// as infinitely far.
ImageDepth least_around(const ImageDepth& depth, int reach) {
  const auto blocks = [](int size) { return (size + kBlendBlock_px - 1) / kBlendBlock_px; };
  ImageDepth least(blocks(depth.width), blocks(depth.height), 1e9f);
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x)
      if (const float d = *depth.at(x, y); d > 0) {
        float& l = *least.at(x / kBlendBlock_px, y / kBlendBlock_px);
        l = std::min(l, d);
      }
  ImageDepth rows = least, out = least;
  for (int y = 0; y < least.height; ++y)
    for (int x = 0; x < least.width; ++x)
      for (int i = std::max(0, x - reach); i <= std::min(least.width - 1, x + reach); ++i)
        *rows.at(x, y) = std::min(*rows.at(x, y), *least.at(i, y));
  for (int y = 0; y < least.height; ++y)
    for (int x = 0; x < least.width; ++x) {
      *out.at(x, y) = *rows.at(x, y);
      for (int i = std::max(0, y - reach); i <= std::min(least.height - 1, y + reach); ++i)
        *out.at(x, y) = std::min(*out.at(x, y), *rows.at(x, i));
    }
  return out;
}

/// A rigid transform in floats.
struct Transform {
  std::array<Vec3f, 3> rows;
  Vec3f translation;

  explicit Transform(const Pose& pose) : translation(vec_cast<float>(pose.translation)) {
    for (int i = 0; i < 3; ++i) rows[i] = vec_cast<float>(pose.rotation.row(i));
  }
  Vec3f operator*(Vec3f p) const {
    return Vec3f{dot(rows[0], p), dot(rows[1], p), dot(rows[2], p)} + translation;
  }
};

}  // namespace

/// A source, prepared.
struct ViewBlend::Eye {
  static constexpr std::array<int, 2> kReach{1, 4};               // blocks
  static constexpr std::array<float, 3> kSeen{0.1f, 0.5f, 1.0f};  // weight by how far edges are

  explicit Eye(const Source& source)
      : source(source),
        view(*source.view),
        shader(view, source.field, source.log_exposure),
        scale_x(static_cast<float>(view.atlas_rect.width) / view.image_rect.width),
        scale_y(static_cast<float>(view.atlas_rect.height) / view.image_rect.height),
        border(kBorder_px * view.width / 640.0f) {
    if (source.nearest)
      for (std::size_t i = 0; i < around.size(); ++i)
        around[i] = least_around(*source.nearest, kReach[i]);
  }

  bool blends() const { return source.nearest && view.kind == View::Kind::pinhole; }

  /// Where the middle of a pixel of the tile lies in the camera's picture.
  float camera_column(int x) const {
    return (static_cast<float>(x) + 0.5f) / scale_x - 0.5f + static_cast<float>(view.image_rect.x);
  }
  float camera_row(int y) const {
    return (static_cast<float>(y) + 0.5f) / scale_y - 0.5f + static_cast<float>(view.image_rect.y);
  }

  /// The point at a pixel of the camera's picture, in the camera's space.
  Vec3f point(Vec2f pixel, float z) const {
    return Vec3f{(pixel.x - static_cast<float>(view.cx)) / static_cast<float>(view.fx),
                 (pixel.y - static_cast<float>(view.cy)) / static_cast<float>(view.fy), 1} *
           z;
  }

  /// Where a point in the camera's space lies in the camera's picture.
  Vec2f pixel(Vec3f p) const {
    return {static_cast<float>(view.fx) * p.x / p.z + static_cast<float>(view.cx),
            static_cast<float>(view.fy) * p.y / p.z + static_cast<float>(view.cy)};
  }

  /// The share of its full weight that the view has at a point, by what hides it, by the border of
  /// its picture and by validity: 0..1.
  float sees(Vec2f at, float z) const {
    const Rect& r = view.image_rect;
    const auto left = static_cast<float>(r.x), top = static_cast<float>(r.y);
    const float inside =
        std::min({at.x - left, at.y - top, left + static_cast<float>(r.width - 1) - at.x,
                  top + static_cast<float>(r.height - 1) - at.y}) -
        view.gutter_px;
    if (!(inside > 0)) return 0;
    const int x = static_cast<int>(at.x + 0.5f), y = static_cast<int>(at.y + 0.5f);
    if (source.valid && !source.valid->at(x / source.valid->tile_px, y / source.valid->tile_px))
      return 0;
    const float front = z - kFront_m - kFront_share * z;
    const float d = *source.nearest->at(x, y);
    if (!(d > 0) || d < front) return 0;
    std::size_t level = 0;
    for (; level < around.size(); ++level) {
      const float reach_px = static_cast<float>((kReach[level] + 1) * kBlendBlock_px);
      const float slope_m = kSteepest * reach_px * z / static_cast<float>(view.fx);
      if (*around[level].at(x / kBlendBlock_px, y / kBlendBlock_px) < front - slope_m) break;
    }
    return kSeen[level] * std::min(1.0f, inside / border);
  }

  /// The corrected colour at a pixel of the camera's picture, 0..255.
  Vec3f color(Vec2f at) const {
    const Rect& r = view.atlas_rect;
    const float u = (at.x + 0.5f - static_cast<float>(view.image_rect.x)) * scale_x - 0.5f;
    const float v = (at.y + 0.5f - static_cast<float>(view.image_rect.y)) * scale_y - 0.5f;
    const float x = std::clamp(u, 0.0f, static_cast<float>(r.width - 1));
    const float y = std::clamp(v, 0.0f, static_cast<float>(r.height - 1));
    const int x0 = std::min(static_cast<int>(x), r.width - 2),
              y0 = std::min(static_cast<int>(y), r.height - 2);
    const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
    const std::uint8_t *a = source.picture->at(r.x + x0, r.y + y0),
                       *b = source.picture->at(r.x + x0, r.y + y0 + 1);
    const auto& curves = shader.curves(x0, y0);
    Vec3f out;
    for (int c = 0; c < 3; ++c) {
      const float top = a[c] + (a[c + 3] - a[c]) * fx, bottom = b[c] + (b[c + 3] - b[c]) * fx;
      const float value = top + (bottom - top) * fy;
      const int low = static_cast<int>(value);
      const float from = curves[c][low], to = curves[c][std::min(low + 1, 255)];
      out[c] = from + (to - from) * (value - static_cast<float>(low));
    }
    return out;
  }

  Source source;
  const View& view;
  TileShader shader;
  float scale_x, scale_y, border;
  std::array<ImageDepth, 2> around;
};

namespace {

/// The normal of the surface at a pixel, towards the camera; from pixels beside it. Straight at the
/// camera where these show other surface.
Vec3f normal_at(const View& view, const ImageDepth& depth, int x, int y, float z) {
  constexpr int kAside = 3;
  const auto point = [&](int u, int v) -> std::optional<Vec3f> {
    if (!depth.contains(u, v)) return std::nullopt;
    const float d = *depth.at(u, v);
    if (!(std::abs(d - z) < 0.1f * z)) return std::nullopt;
    return Vec3f{
               (static_cast<float>(u) - static_cast<float>(view.cx)) / static_cast<float>(view.fx),
               (static_cast<float>(v) - static_cast<float>(view.cy)) / static_cast<float>(view.fy),
               1} *
           d;
  };
  const auto left = point(x - kAside, y), right = point(x + kAside, y);
  const auto above = point(x, y - kAside), below = point(x, y + kAside);
  if (!left || !right || !above || !below) return {0, 0, -1};
  return normalized(cross(*below - *above, *right - *left));
}

/// Pixels per m² of a surface, as a logarithm.
float log_resolution(const View& view, float facing, float z) {
  return std::log(facing * static_cast<float>(view.fx * view.fy) / (z * z));
}

/// The mean of colours.
struct Mix {
  Vec3f sum;
  float weights = 0;

  /// What is nearly white may be a highlight, and tells little about the surface.
  void add(Vec3f color, float weight) {
    if (std::max({color.x, color.y, color.z}) >= kNearWhite) weight *= kNearWhiteWeight;
    sum += color * weight, weights += weight;
  }
};

}  // namespace

namespace {

/// By how much the pixels of a part of a tile change.
struct Changes {
  Rect part;           ///< pixels of the tile
  Image<float, 3> by;  ///< [height, width] of the part
  ImageMask any;       ///< pixels that change at all

  explicit Changes(const Rect& of) : part(of), by(of.width, of.height), any(of.width, of.height) {}
};

/// Means of changes over blocks, smooth: of each block and those around it.
class SmoothChanges {
 public:
  explicit SmoothChanges(const Changes& changes)
      : columns_((changes.any.width + kBlock_px - 1) / kBlock_px),
        rows_((changes.any.height + kBlock_px - 1) / kBlock_px),
        sums_(static_cast<std::size_t>(columns_) * rows_) {
    parallel_for(static_cast<std::size_t>(rows_), 4, [&](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; ++row) sum(changes, static_cast<int>(row));
    });
    const std::vector<Sum> blocks = sums_;
    for (int row = 0; row < rows_; ++row)
      for (int column = 0; column < columns_; ++column) {
        Sum& all = sums_[static_cast<std::size_t>(row) * columns_ + column];
        all = {};
        for (int y = std::max(row - 1, 0); y <= std::min(row + 1, rows_ - 1); ++y)
          for (int x = std::max(column - 1, 0); x <= std::min(column + 1, columns_ - 1); ++x) {
            const Sum& block = blocks[static_cast<std::size_t>(y) * columns_ + x];
            all.change += block.change, all.count += block.count;
          }
      }
  }

  /// Bilinear between the middles of blocks.
  Vec3f at(int x, int y) const {
    const auto along = [](int p, int count) {
      return std::clamp((static_cast<float>(p) + 0.5f) / kBlock_px - 0.5f, 0.0f,
                        static_cast<float>(count - 1));
    };
    const float u = along(x, columns_), v = along(y, rows_);
    const int x0 = static_cast<int>(u), y0 = static_cast<int>(v);
    const float fx = u - static_cast<float>(x0), fy = v - static_cast<float>(y0);
    Vec3f change;
    float weights = 0;
    const auto add = [&](int column, int row, float weight) {
      const Sum& s = sums_[static_cast<std::size_t>(std::min(row, rows_ - 1)) * columns_ +
                           std::min(column, columns_ - 1)];
      if (s.count == 0) return;
      change += s.change * (weight / s.count), weights += weight;
    };
    add(x0, y0, (1 - fx) * (1 - fy)), add(x0 + 1, y0, fx * (1 - fy));
    add(x0, y0 + 1, (1 - fx) * fy), add(x0 + 1, y0 + 1, fx * fy);
    return weights > 0 ? change / weights : change;
  }

 private:
  static constexpr int kBlock_px = 8;
  struct Sum {
    Vec3f change;
    float count = 0;
  };

  void sum(const Changes& changes, int row) {
    const int end = std::min((row + 1) * kBlock_px, changes.any.height);
    for (int y = row * kBlock_px; y < end; ++y)
      for (int x = 0; x < changes.any.width; ++x) {
        if (!*changes.any.at(x, y)) continue;
        Sum& s = sums_[static_cast<std::size_t>(row) * columns_ + x / kBlock_px];
        const float* const by = changes.by.at(x, y);
        s.change += Vec3f{by[0], by[1], by[2]}, s.count += 1;
      }
  }

  int columns_, rows_;
  std::vector<Sum> sums_;  ///< [rows, columns] of blocks
};

/// Leaves only the smooth part.
void smooth(Changes& changes) {
  const SmoothChanges smoothed(changes);
  parallel_for(static_cast<std::size_t>(changes.any.height), 16,
               [&](std::size_t begin, std::size_t end) {
                 for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
                   for (int x = 0; x < changes.any.width; ++x) {
                     if (!*changes.any.at(x, y)) continue;
                     const Vec3f by = smoothed.at(x, y);
                     for (int c = 0; c < 3; ++c) changes.by.at(x, y)[c] = by[c];
                   }
               });
}

}  // namespace

/// Blends the picture of one view.
class ViewBlend::Painter {
 public:
  Painter(const std::vector<std::unique_ptr<const Eye>>& eyes, std::size_t own, float sharpness,
          ImageRgb& out)
      : own_(*eyes[own]), view_(own_.view), sharpness_(sharpness), out_(out) {
    for (std::size_t i = 0; i < eyes.size(); ++i) {
      if (i == own || !eyes[i]->blends()) continue;
      const Pose T_own_other = view_.T_world_camera.inverse() * eyes[i]->view.T_world_camera;
      others_.push_back({eyes[i].get(), Transform(T_own_other.inverse()),
                         vec_cast<float>(T_own_other.translation)});
    }
  }

  bool blends() const { return own_.blends() && !others_.empty(); }

  /// Corrects a row of the view's tile.
  void correct(int y) {
    const Rect& at = view_.atlas_rect;
    if (!own_.shader.is_plain()) own_.shader.apply(0, y, at.width, out_.at(at.x, at.y + y));
  }

  /// The part of the tile that shows pixels of the camera's picture with `surface` that are used.
  Rect part(const ImageMask* used, const ImageDepth& surface) const {
    const Rect &at = view_.atlas_rect, &shown = view_.image_rect;
    int left = shown.x + shown.width, top = shown.y + shown.height, right = -1, bottom = -1;
    for (int y = shown.y; y < shown.y + shown.height; ++y)
      for (int x = shown.x; x < shown.x + shown.width; ++x)
        if (*surface.at(x, y) > 0 && (!used || *used->at(x, y)))
          left = std::min(left, x), right = std::max(right, x), top = std::min(top, y), bottom = y;
    if (right < 0) return {};
    const auto in_tile = [](int p, int first, float scale, int size) {
      return std::clamp(static_cast<int>(static_cast<float>(p - first) * scale), 0, size - 1);
    };
    const int x0 = in_tile(left - 1, shown.x, own_.scale_x, at.width),
              y0 = in_tile(top - 1, shown.y, own_.scale_y, at.height);
    return {x0, y0, in_tile(right + 2, shown.x, own_.scale_x, at.width) + 1 - x0,
            in_tile(bottom + 2, shown.y, own_.scale_y, at.height) + 1 - y0};
  }

  /// Finds how a corrected row of a part would change to what all views show.
  void compare(int y, const ImageMask* used, const ImageDepth& surface, Changes& changes) const {
    const Rect &at = view_.atlas_rect, &part = changes.part;
    const float camera_y = own_.camera_row(part.y + y);
    const int row = std::clamp(static_cast<int>(camera_y + 0.5f), 0, view_.height - 1);
    Vec3f normal;
    int normal_of = -1;  // block of columns
    for (int x = 0; x < part.width; ++x) {
      const float camera_x = own_.camera_column(part.x + x);
      const int column = std::clamp(static_cast<int>(camera_x + 0.5f), 0, view_.width - 1);
      const float z = *surface.at(column, row);
      if (!(z > 0) || (used && !*used->at(column, row))) continue;
      if (const int block = column / kBlendBlock_px; block != normal_of)
        normal = normal_at(view_, surface, column, row, z), normal_of = block;
      const std::uint8_t* const rgb = out_.at(at.x + part.x + x, at.y + part.y + y);
      const Vec3f color =
          mean({camera_x, camera_y}, z, normal, {rgb[0] + 0.0f, rgb[1] + 0.0f, rgb[2] + 0.0f});
      *changes.any.at(x, y) = 1;
      for (int c = 0; c < 3; ++c) changes.by.at(x, y)[c] = color[c] - static_cast<float>(rgb[c]);
    }
  }

  void change(int y, const Changes& changes) {
    const Rect &at = view_.atlas_rect, &part = changes.part;
    for (int x = 0; x < part.width; ++x) {
      if (!*changes.any.at(x, y)) continue;
      std::uint8_t* const rgb = out_.at(at.x + part.x + x, at.y + part.y + y);
      for (int c = 0; c < 3; ++c)
        rgb[c] = static_cast<std::uint8_t>(
            std::clamp(static_cast<float>(rgb[c]) + changes.by.at(x, y)[c] + 0.5f, 0.0f, 255.0f));
    }
  }

 private:
  struct Other {
    const Eye* eye;
    Transform from_own;  ///< from the own camera's space
    Vec3f centre;        ///< of the other camera, in the own camera's space
  };

  /// The mean colour of a point at a pixel of the own camera. `shown`: by the own picture.
  Vec3f mean(Vec2f pixel, float z, Vec3f normal, Vec3f shown) const {
    constexpr float kLeastFacing = 0.15f, kNear_m = 0.05f;
    const Vec3f p = own_.point(pixel, z);
    const auto facing = [&](Vec3f eye) { return dot(normal, normalized(eye - p)); };
    const float own_resolution = log_resolution(view_, std::max(facing({}), kLeastFacing), z);
    Mix mix;
    mix.add(shown, std::max(own_.sees(pixel, z), kLeast));
    for (const Other& other : others_) {
      const Vec3f q = other.from_own * p;
      const float faces = facing(other.centre);
      if (faces < kLeastFacing || !(q.z > kNear_m)) continue;
      const Vec2f at = other.eye->pixel(q);
      if (const float sees = other.eye->sees(at, q.z); sees > 0)
        mix.add(other.eye->color(at),
                sees * std::exp(sharpness_ *
                                (log_resolution(other.eye->view, faces, q.z) - own_resolution)));
    }
    return mix.sum / mix.weights;
  }

  const Eye& own_;
  const View& view_;
  float sharpness_;
  ImageRgb& out_;
  std::vector<Other> others_;
};

ViewBlend::ViewBlend(std::vector<Source> sources, const BlendConfig& config) : config_(config) {
  eyes_.resize(sources.size());
  parallel_for(sources.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) eyes_[i] = std::make_unique<const Eye>(sources[i]);
  });
}
ViewBlend::~ViewBlend() = default;
ViewBlend::ViewBlend(ViewBlend&&) noexcept = default;

ImageRgb ViewBlend::picture(std::size_t source, const ImageMask* used,
                            const ImageDepth* surface) const {
  ImageRgb out = *eyes_[source]->source.picture;
  Painter painter(eyes_, source, static_cast<float>(config_.sharpness), out);
  const auto rows = [](int count, const auto& row) {
    parallel_for(static_cast<std::size_t>(count), 8, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) row(y);
    });
  };
  rows(eyes_[source]->view.atlas_rect.height, [&](int y) { painter.correct(y); });
  if (!surface || !painter.blends()) return out;
  Changes changes(painter.part(used, *surface));
  rows(changes.part.height, [&](int y) { painter.compare(y, used, *surface, changes); });
  if (config_.keep_detail && !changes.part.empty()) smooth(changes);
  rows(changes.part.height, [&](int y) { painter.change(y, changes); });
  return out;
}

}  // namespace mr::atlas
