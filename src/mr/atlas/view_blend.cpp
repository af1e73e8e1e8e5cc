#include "mr/atlas/view_blend.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <optional>
#include <utility>

#include "mr/atlas/occluders.h"
#include "mr/core/assert.h"
#include "mr/core/parallel.h"

namespace mr::atlas {
namespace {

constexpr int kBlendBlock_px =
    4;  // of the coarsest depth maps, and of normals; pixels of a picture
constexpr float kFront_m = 0.03f, kFront_share = 0.01f;  // nearer surface hides a point
constexpr float kSteepest = 3;    // depth over width of surface that does not hide itself
constexpr float kBorder_px = 40;  // of a picture of 640 columns; weights fall towards its border
constexpr float kLeast = 0.02f;   // weight of a picture in its own tile
constexpr float kNearWhiteWeight = 0.25f;
constexpr int kNearWhite = 250;

/// The least depth of each block of pixels of a depth map; nothing counts as infinitely far.
ImageDepth least_of_blocks(const ImageDepth& depth, int block_px) {
  const auto blocks = [&](int size) { return (size + block_px - 1) / block_px; };
  ImageDepth least(blocks(depth.width), blocks(depth.height), 1e9f);
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x)
      if (const float d = *depth.at(x, y); d > 0) {
        float& l = *least.at(x / block_px, y / block_px);
        l = std::min(l, d);
      }
  return least;
}

/// The least of each value and of those up to `reach` beside, above and below it.
ImageDepth least_around(const ImageDepth& of, int reach) {
  const auto lower = [](float* out, const float* other, int count) {
    for (int i = 0; i < count; ++i) out[i] = std::min(out[i], other[i]);
  };
  ImageDepth rows = of;
  for (int y = 0; y < of.height; ++y)
    for (int by = 1; by <= std::min(reach, of.width - 1); ++by) {
      lower(rows.at(0, y), of.at(by, y), of.width - by);
      lower(rows.at(by, y), of.at(0, y), of.width - by);
    }
  ImageDepth out = rows;
  for (int y = 0; y < of.height; ++y)
    for (int i = std::max(0, y - reach); i <= std::min(of.height - 1, y + reach); ++i)
      lower(out.at(0, y), rows.at(0, i), of.width);
  return out;
}

/// The share of its weight that a valid pixel has: none along invalid tiles, bilinear between the
/// corners of its tile, so that it is full a tile from them.
class Validity {
 public:
  explicit Validity(const TileMask& mask)
      : tile_px_(static_cast<float>(mask.tile_px)),
        columns_(mask.columns + 1),
        corners_(static_cast<std::size_t>(columns_) * (mask.rows + 1), 1) {
    for (int row = 0; row < mask.rows; ++row)
      for (int column = 0; column < mask.columns; ++column)
        if (!mask.at(column, row))
          for (const int below : {0, 1})
            for (const int right : {0, 1}) corners_[corner(column + right, row + below)] = 0;
  }

  /// At a pixel of the picture; 0 in invalid tiles.
  float at(Vec2f pixel) const {
    const float x = (pixel.x + 0.5f) / tile_px_, y = (pixel.y + 0.5f) / tile_px_;
    const int column = static_cast<int>(x), row = static_cast<int>(y);
    const std::uint8_t* const above = &corners_[corner(column, row)];
    const std::uint8_t* const below = above + columns_;
    const int valid = above[0] + above[1] + below[0] + below[1];
    if (valid % 4 == 0) return static_cast<float>(valid / 4);
    const float right = x - static_cast<float>(column), down = y - static_cast<float>(row);
    const auto between = [&](const std::uint8_t* c) {
      return static_cast<float>(c[0]) * (1 - right) + static_cast<float>(c[1]) * right;
    };
    return between(above) * (1 - down) + between(below) * down;
  }

 private:
  std::size_t corner(int column, int row) const {
    return static_cast<std::size_t>(row) * columns_ + column;
  }

  float tile_px_;
  int columns_;
  std::vector<std::uint8_t> corners_;  ///< of tiles: 1 where all tiles around are valid
};

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
struct ViewBlend::PreparedView {
  static constexpr std::array<int, 2> kReach{1, 4};                   // blocks
  static constexpr std::array<float, 3> kUnhidden{0.1f, 0.5f, 1.0f};  // weight by how far edges are

  explicit PreparedView(const Source& source)
      : source(source),
        view(*source.view),
        shader(view, source.field, source.log_exposure),
        scale_x(static_cast<float>(view.atlas_rect.width) / view.image_rect.width),
        scale_y(static_cast<float>(view.atlas_rect.height) / view.image_rect.height),
        border(kBorder_px * view.width / 640.0f),
        divisor(blends() ? depth_divisor(view.camera()) : 1) {
    if (!blends()) return;
    if (source.valid) validity.emplace(*source.valid);
    MR_ASSERT(kBlendBlock_px / divisor > 0);
    const ImageDepth least = least_of_blocks(*source.nearest, kBlendBlock_px / divisor);
    for (std::size_t i = 0; i < around.size(); ++i) around[i] = least_around(least, kReach[i]);
  }

  bool blends() const { return source.nearest && view.kind == View::Kind::pinhole; }

  /// The depth in a depth map of the view (depth_camera) at a pixel of the camera's picture.
  float depth(const ImageDepth& map, int x, int y) const {
    return *map.at(std::min(x / divisor, map.width - 1), std::min(y / divisor, map.height - 1));
  }

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
  float visibility(Vec2f at, float z) const {
    const Rect& r = view.image_rect;
    const auto left = static_cast<float>(r.x), top = static_cast<float>(r.y);
    const float inside =
        std::min({at.x - left, at.y - top, left + static_cast<float>(r.width - 1) - at.x,
                  top + static_cast<float>(r.height - 1) - at.y}) -
        view.gutter_px;
    if (!(inside > 0)) return 0;
    const int x = static_cast<int>(at.x + 0.5f), y = static_cast<int>(at.y + 0.5f);
    const float valid = validity ? validity->at(at) : 1;
    if (!(valid > 0)) return 0;
    const float front = z - kFront_m - kFront_share * z;
    const float d = depth(*source.nearest, x, y);
    if (!(d > 0) || d < front) return 0;
    std::size_t level = 0;
    for (; level < around.size(); ++level) {
      const float reach_px = static_cast<float>((kReach[level] + 1) * kBlendBlock_px);
      const float slope_m = kSteepest * reach_px * z / static_cast<float>(view.fx);
      const int column = std::min(x / kBlendBlock_px, around[level].width - 1),
                row = std::min(y / kBlendBlock_px, around[level].height - 1);
      if (*around[level].at(column, row) < front - slope_m) break;
    }
    return kUnhidden[level] * valid * std::min(1.0f, inside / border);
  }

  /// The corrected colour at a pixel of the camera's picture, 0..255.
  Vec3f color(Vec2f at) const {
    const Rect& r = view.atlas_rect;
    const float u = (at.x + 0.5f - static_cast<float>(view.image_rect.x)) * scale_x - 0.5f;
    const float v = (at.y + 0.5f - static_cast<float>(view.image_rect.y)) * scale_y - 0.5f;
    const float x = std::clamp(u, 0.0f, static_cast<float>(r.width - 1));
    const float y = std::clamp(v, 0.0f, static_cast<float>(r.height - 1));
    // In a tile one pixel wide or high, both neighbours are that pixel.
    const int x0 = std::min(static_cast<int>(x), std::max(r.width - 2, 0)),
              y0 = std::min(static_cast<int>(y), std::max(r.height - 2, 0));
    const int next = r.width > 1 ? 3 : 0, below = r.height > 1;
    const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
    const std::uint8_t *a = source.picture->at(r.x + x0, r.y + y0),
                       *b = source.picture->at(r.x + x0, r.y + y0 + below);
    const auto& curves = shader.curves(x0, y0);
    Vec3f out;
    for (int c = 0; c < 3; ++c) {
      const float top = a[c] + (a[c + next] - a[c]) * fx, bottom = b[c] + (b[c + next] - b[c]) * fx;
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
  int divisor;  ///< of depth maps
  std::array<ImageDepth, 2> around;
  std::optional<Validity> validity;  ///< none: all pixels are valid
};

namespace {

/// The normal of the surface at a pixel of a camera's depth map, towards the camera; from pixels
/// `aside` beside it. Straight at the camera where these show other surface.
Vec3f normal_at(const Camera& camera, const ImageDepth& depth, int x, int y, int aside) {
  const float z = *depth.at(x, y);
  const auto point = [&](int u, int v) -> std::optional<Vec3f> {
    if (!depth.contains(u, v)) return std::nullopt;
    const float d = *depth.at(u, v);
    if (!(std::abs(d - z) < 0.1f * z)) return std::nullopt;
    return Vec3f{static_cast<float>((u - camera.cx) / camera.fx),
                 static_cast<float>((v - camera.cy) / camera.fy), 1} *
           d;
  };
  const auto left = point(x - aside, y), right = point(x + aside, y);
  const auto above = point(x, y - aside), below = point(x, y + aside);
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

/// The smooth part of how the colours of a part of a tile change: of each block of pixels the mean
/// over it and the blocks around it, bilinear between the middles of blocks.
class SmoothChange {
 public:
  static constexpr int kBlock_px = 8;
  static constexpr int kReach_px = 3 * kBlock_px;  ///< beside pixels that were added

  SmoothChange(int width, int height)
      : columns_((width + kBlock_px - 1) / kBlock_px),
        rows_((height + kBlock_px - 1) / kBlock_px),
        blocks_(static_cast<std::size_t>(columns_) * rows_) {}

  int rows() const { return rows_; }
  /// Adds the change of a pixel. Rows of blocks are apart from each other.
  void add(int x, int y, Vec3f change) {
    Block& block = blocks_[static_cast<std::size_t>(y / kBlock_px) * columns_ + x / kBlock_px];
    block.sum += change, block.count += 1;
  }
  /// Once all is added. Blocks without a pixel become what is around them.
  void smooth() {
    blocks_ = around(true);
    blocks_ = around(false);
  }
  /// The changes of a row of pixels, by column; none three blocks from where pixels were added.
  class Row {
   public:
    Row(const SmoothChange& of, int y) : changes_(static_cast<std::size_t>(of.columns_) + 1) {
      const auto [above, share] = between(y, of.rows_);
      const Block* const a = of.blocks_.data() + static_cast<std::size_t>(above) * of.columns_;
      const Block* const b = above + 1 < of.rows_ ? a + of.columns_ : a;
      for (int column = 0; column < of.columns_; ++column)
        changes_[column] = a[column].sum * (1 - share) + b[column].sum * share;
      changes_.back() = changes_[of.columns_ - 1];
    }
    Vec3f at(int x) const {
      const auto [left, share] = between(x, static_cast<int>(changes_.size()) - 1);
      return changes_[left] + (changes_[left + 1] - changes_[left]) * share;
    }

   private:
    std::vector<Vec3f> changes_;  ///< of columns of blocks; the last one twice
  };

 private:
  struct Block {
    Vec3f sum;        ///< of changes; once smoothed, the mean
    float count = 0;  ///< of pixels; once smoothed, 1 where there are any
  };

  /// The block whose middle is before a pixel, and how far the pixel is towards the next: 0..1.
  static std::pair<int, float> between(int p, int count) {
    const float at = std::clamp((static_cast<float>(p) + 0.5f) / kBlock_px - 0.5f, 0.0f,
                                static_cast<float>(count - 1));
    const int before = static_cast<int>(at);
    return {before, at - static_cast<float>(before)};
  }

  /// The means of blocks and those around them: of `all`, or only of those without a pixel.
  std::vector<Block> around(bool all) const {
    std::vector<Block> out = blocks_;
    for (int row = 0; row < rows_; ++row)
      for (int column = 0; column < columns_; ++column) {
        Block& mean = out[static_cast<std::size_t>(row) * columns_ + column];
        if (!all && mean.count > 0) continue;
        mean = {};
        for (int y = std::max(row - 1, 0); y <= std::min(row + 1, rows_ - 1); ++y)
          for (int x = std::max(column - 1, 0); x <= std::min(column + 1, columns_ - 1); ++x) {
            const Block& block = blocks_[static_cast<std::size_t>(y) * columns_ + x];
            mean.sum += block.sum, mean.count += block.count;
          }
        if (mean.count > 0) mean.sum = mean.sum / mean.count, mean.count = 1;
      }
    return out;
  }

  int columns_, rows_;
  std::vector<Block> blocks_;  ///< [rows, columns]
};

}  // namespace

/// Blends the picture of one view.
class ViewBlend::Painter {
 public:
  Painter(const std::vector<std::unique_ptr<const PreparedView>>& views, std::size_t own,
          float sharpness, ImageRgb& out)
      : own_(*views[own]),
        view_(own_.view),
        depth_camera_(depth_camera(view_.camera())),
        sharpness_(sharpness),
        out_(out) {
    for (std::size_t i = 0; i < views.size(); ++i) {
      if (i == own || !views[i]->blends()) continue;
      const Pose T_own_other = view_.T_world_camera.inverse() * views[i]->view.T_world_camera;
      others_.push_back({views[i].get(), Transform(T_own_other.inverse()),
                         vec_cast<float>(T_own_other.translation)});
    }
  }

  bool blends() const { return own_.blends() && !others_.empty(); }

  /// Corrects a row of the view's tile.
  void correct(int y) {
    const Rect& at = view_.atlas_rect;
    if (!own_.shader.is_plain()) own_.shader.apply(0, y, at.width, out_.at(at.x, at.y + y));
  }

  /// The part of the tile that shows pixels of the camera's picture with `surface` that are used,
  /// and `around_px` around it.
  Rect part(const ImageMask* used, const ImageDepth& surface, int around_px) const {
    const Rect &at = view_.atlas_rect, &shown = view_.image_rect;
    int left = shown.x + shown.width, top = shown.y + shown.height, right = -1, bottom = -1;
    for (int y = shown.y; y < shown.y + shown.height; ++y) {
      int x = shown.x, x_end = shown.x + shown.width;
      if (used) {  // most pixels are not: searched fast
        const std::uint8_t *const first = used->at(x, y), *const end = first + shown.width;
        x += static_cast<int>(std::find(first, end, 1) - first);
        const auto last = std::find(std::reverse_iterator(end), std::reverse_iterator(first), 1);
        x_end -= static_cast<int>(last - std::reverse_iterator(end));
      }
      for (; x < x_end; ++x)
        if ((!used || *used->at(x, y)) && own_.depth(surface, x, y) > 0)
          left = std::min(left, x), right = std::max(right, x), top = std::min(top, y), bottom = y;
    }
    if (right < 0) return {};
    const auto in_tile = [](int p, int first, float scale, int around, int size) {
      return std::clamp(static_cast<int>(static_cast<float>(p - first) * scale) + around, 0,
                        size - 1);
    };
    const int x0 = in_tile(left - 1, shown.x, own_.scale_x, -around_px, at.width),
              y0 = in_tile(top - 1, shown.y, own_.scale_y, -around_px, at.height);
    return {x0, y0, in_tile(right + 2, shown.x, own_.scale_x, around_px, at.width) + 1 - x0,
            in_tile(bottom + 2, shown.y, own_.scale_y, around_px, at.height) + 1 - y0};
  }

  /// Makes a corrected row of a part of the tile what all views show.
  void average(int y, const Rect& part, const ImageMask* used, const ImageDepth& surface) {
    each_shown(y, {0, 1}, part, used, surface, [](int, std::uint8_t* rgb, Vec3f mean) {
      for (int c = 0; c < 3; ++c) rgb[c] = static_cast<std::uint8_t>(mean[c] + 0.5f);
    });
  }

  /// Finds how a row of blocks of a part would change to what all views show. One pixel of eight,
  /// staggered, tells it, as only its smooth part is kept.
  void compare(int row, const Rect& part, const ImageMask* used, const ImageDepth& surface,
               SmoothChange& change) const {
    const int begin = row * SmoothChange::kBlock_px;
    const int end = std::min(begin + SmoothChange::kBlock_px, part.height);
    for (int y = begin; y < end; y += 2)
      each_shown(y, {y % 4, 4}, part, used, surface,
                 [&](int x, const std::uint8_t* rgb, Vec3f mean) {
                   change.add(x, y, mean - Vec3f{rgb[0] + 0.0f, rgb[1] + 0.0f, rgb[2] + 0.0f});
                 });
  }

  /// Changes a row of a part, as far as it is used.
  void apply(int y, const Rect& part, const ImageMask* used, const SmoothChange& change) {
    const Rect& at = view_.atlas_rect;
    const int row = nearest(own_.camera_row(part.y + y), view_.height);
    const SmoothChange::Row changes(change, y);
    for (int x = 0; x < part.width; ++x) {
      if (used && !*used->at(nearest(own_.camera_column(part.x + x), view_.width), row)) continue;
      std::uint8_t* const rgb = out_.at(at.x + part.x + x, at.y + part.y + y);
      const Vec3f by = changes.at(x);
      for (int c = 0; c < 3; ++c)
        rgb[c] = static_cast<std::uint8_t>(
            std::clamp(static_cast<float>(rgb[c]) + by[c] + 0.5f, 0.0f, 255.0f));
    }
  }

 private:
  struct Other {
    const PreparedView* view;
    Transform from_own;  ///< from the own camera's space
    Vec3f centre;        ///< of the other camera, in the own camera's space
  };

  static int nearest(float p, int size) {
    return std::clamp(static_cast<int>(p + 0.5f), 0, size - 1);
  }

  /// Some columns.
  struct Columns {
    int first, stride;
  };

  /// Calls `f` with the column in the part, the pixel, and the mean colour of all views, for pixels
  /// of a corrected row that are used and show `surface`.
  template <typename F>
  void each_shown(int y, Columns columns, const Rect& part, const ImageMask* used,
                  const ImageDepth& surface, const F& f) const {
    const int aside = (kAside_px + own_.divisor - 1) / own_.divisor;
    const float camera_y = own_.camera_row(part.y + y);
    const int row = nearest(camera_y, view_.height);
    Vec3f normal;
    int normal_of = -1;  // block of columns
    for (int x = columns.first; x < part.width; x += columns.stride) {
      const float camera_x = own_.camera_column(part.x + x);
      const int column = nearest(camera_x, view_.width);
      const float z = own_.depth(surface, column, row);
      if (!(z > 0) || (used && !*used->at(column, row))) continue;
      if (const int block = column / kBlendBlock_px; block != normal_of) {
        const int u = std::min(column / own_.divisor, surface.width - 1),
                  v = std::min(row / own_.divisor, surface.height - 1);
        normal = normal_at(depth_camera_, surface, u, v, aside), normal_of = block;
      }
      const Rect& at = view_.atlas_rect;
      std::uint8_t* const rgb = out_.at(at.x + part.x + x, at.y + part.y + y);
      f(x, rgb,
        mean({camera_x, camera_y}, z, normal, {rgb[0] + 0.0f, rgb[1] + 0.0f, rgb[2] + 0.0f}));
    }
  }

  /// The mean colour of a point at a pixel of the own camera. `shown`: by the own picture.
  Vec3f mean(Vec2f pixel, float z, Vec3f normal, Vec3f shown) const {
    constexpr float kLeastFacing = 0.15f, kNear_m = 0.05f;
    const Vec3f p = own_.point(pixel, z);
    const auto facing = [&](Vec3f centre) { return dot(normal, normalized(centre - p)); };
    const float own_resolution = log_resolution(view_, std::max(facing({}), kLeastFacing), z);
    Mix mix;
    mix.add(shown, std::max(own_.visibility(pixel, z), kLeast));
    for (const Other& other : others_) {
      const Vec3f q = other.from_own * p;
      const float faces = facing(other.centre);
      if (faces < kLeastFacing || !(q.z > kNear_m)) continue;
      const Vec2f at = other.view->pixel(q);
      if (const float visible = other.view->visibility(at, q.z); visible > 0)
        mix.add(other.view->color(at),
                visible * std::exp(sharpness_ * (log_resolution(other.view->view, faces, q.z) -
                                                 own_resolution)));
    }
    return mix.sum / mix.weights;
  }

  static constexpr int kAside_px = 3;  // of normals

  const PreparedView& own_;
  const View& view_;
  Camera depth_camera_;
  float sharpness_;
  ImageRgb& out_;
  std::vector<Other> others_;
};

ViewBlend::ViewBlend(std::vector<Source> sources, const BlendConfig& config) : config_(config) {
  views_.resize(sources.size());
  parallel_for(sources.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      views_[i] = std::make_unique<const PreparedView>(sources[i]);
  });
}
ViewBlend::~ViewBlend() = default;
ViewBlend::ViewBlend(ViewBlend&&) noexcept = default;

ImageRgb ViewBlend::picture(std::size_t source, const ImageMask* used,
                            const ImageDepth* surface) const {
  ImageRgb out = *views_[source]->source.picture;
  Painter painter(views_, source, static_cast<float>(config_.sharpness), out);
  const auto rows = [](int count, int grain, const auto& row) {
    parallel_for(static_cast<std::size_t>(count), grain, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) row(y);
    });
  };
  rows(views_[source]->view.atlas_rect.height, 16, [&](int y) { painter.correct(y); });
  if (!surface || !painter.blends()) return out;
  const int around_px = config_.keep_detail ? SmoothChange::kReach_px : 0;
  const Rect part = painter.part(used, *surface, around_px);
  if (part.empty()) return out;
  if (!config_.keep_detail) {
    rows(part.height, 8, [&](int y) { painter.average(y, part, used, *surface); });
    return out;
  }
  SmoothChange change(part.width, part.height);
  rows(change.rows(), 1, [&](int row) { painter.compare(row, part, used, *surface, change); });
  change.smooth();
  rows(part.height, 16, [&](int y) { painter.apply(y, part, used, change); });
  return out;
}

}  // namespace mr::atlas
