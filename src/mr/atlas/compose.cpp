#include "mr/atlas/compose.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "mr/atlas/morphology.h"
#include "mr/core/parallel.h"
#include "mr/kit/raster.h"

namespace mr::atlas {
namespace {

constexpr int kBlock_px = 16;  // of a tile: a macroblock

/// The source of a tile's row or column: linear interpolation between two of the child's.
struct Source {
  int first = 0, second = 0;  ///< the child's rows or columns
  double share = 0;           ///< weight of the second
  int camera = 0;             ///< nearest pixel of the camera picture
};

/// Columns or rows of a rectangle.
struct Extent {
  int first, count;
};
Extent columns_of(const Rect& r) { return {r.x, r.width}; }
Extent rows_of(const Rect& r) { return {r.y, r.height}; }

/// Resampling along one axis: tile pixel → camera pixel → pixel of the child's picture; pixel
/// centres at integers. `shown`: the camera pixels that the tile shows; `child_shown`: those that
/// the child's picture shows at `child`.
std::vector<Source> sources(int tile_count, Extent shown, Extent child_shown, Extent child,
                            int camera_count) {
  std::vector<Source> out(tile_count);
  const double scale = static_cast<double>(shown.count) / tile_count;
  const double child_scale = static_cast<double>(child.count) / child_shown.count;
  const int child_last = child.first + child.count - 1;
  for (int i = 0; i < tile_count; ++i) {
    const double camera = (i + 0.5) * scale + shown.first - 0.5;
    double at = (camera + 0.5 - child_shown.first) * child_scale + child.first - 0.5;
    if (std::abs(at - std::round(at)) < 1e-6) at = std::round(at);  // no interpolation
    at = std::clamp<double>(at, child.first, child_last);
    const int first = static_cast<int>(at);
    out[i] = {first, std::min(first + 1, child_last), at - first,
              std::clamp(static_cast<int>(std::lround(camera)), 0, camera_count - 1)};
  }
  return out;
}

/// Whether the columns are consecutive and not interpolated, so that rows can be copied.
bool is_straight(const std::vector<Source>& columns) {
  for (int i = 0; i < static_cast<int>(columns.size()); ++i)
    if (columns[i].share != 0 || columns[i].first != columns[0].first + i ||
        columns[i].camera != columns[0].camera + i)
      return false;
  return true;
}

/// Bilinear interpolation of four pixels.
void mix(const ImageRgb& picture, const Source& column, const Source& row, std::uint8_t* out) {
  for (int c = 0; c < 3; ++c) {
    const auto line = [&](int y) {
      return picture.at(column.first, y)[c] * (1 - column.share) +
             picture.at(column.second, y)[c] * column.share;
    };
    out[c] = static_cast<std::uint8_t>(line(row.first) * (1 - row.share) +
                                       line(row.second) * row.share + 0.5);
  }
}

/// Draws a row. `used`: mask of the camera's row; null: all pixels.
void draw_row(const ImageRgb& picture, std::span<const Source> columns, const Source& row,
              const std::uint8_t* used, std::uint8_t* out) {
  for (const Source& column : columns) {
    if (!used || used[column.camera]) {
      if (column.share == 0 && row.share == 0)
        std::copy_n(picture.at(column.first, row.first), 3, out);
      else
        mix(picture, column, row, out);
    }
    out += 3;
  }
}

/// The inputs of one tile; `used` and `behind` may be null.
struct TileSources {
  const ImageRgb& picture;
  const ImageMask* used;
  bool mask;
  const ImageRgb* behind;
};

/// Draws one tile of an atlas.
class TileDrawer {
 public:
  TileDrawer(const View& tile, const View& child, const TileSources& from, ImageRgb& atlas)
      : at_(tile.atlas_rect),
        from_(from),
        columns_(sources(at_.width, columns_of(tile.image_rect), columns_of(child.image_rect),
                         columns_of(child.atlas_rect), tile.width)),
        rows_(sources(at_.height, rows_of(tile.image_rect), rows_of(child.image_rect),
                      rows_of(child.atlas_rect), tile.height)),
        straight_(is_straight(columns_)),
        atlas_(atlas) {}

  void draw() const {
    const auto lines = static_cast<std::size_t>((at_.height + kBlock_px - 1) / kBlock_px);
    parallel_for(lines, 1, [&](std::size_t begin, std::size_t end) {
      for (auto y = static_cast<int>(begin) * kBlock_px; y < static_cast<int>(end) * kBlock_px;
           y += kBlock_px)
        draw_line({0, y, at_.width, std::min(kBlock_px, at_.height - y)});
    });
  }

 private:
  /// Draws a line of blocks.
  void draw_line(const Rect& line) const {
    if (!from_.behind || !from_.used)
      return draw(from_.picture, from_.mask ? from_.used : nullptr, line);
    const auto block = [&](int x) {
      return Rect{x, line.y, std::min(kBlock_px, line.width - x), line.height};
    };
    for (int x = 0; x < line.width;) {  // consecutive blocks of one kind at once
      const int first = x;
      const bool used = any_used(block(x));
      do x += kBlock_px;
      while (x < line.width && any_used(block(x)) == used);
      const int end = std::min(x, line.width);
      draw(used ? from_.picture : *from_.behind, nullptr,
           {first, line.y, end - first, line.height});
    }
  }

  bool any_used(const Rect& block) const {
    return std::ranges::any_of(rows_in(block), [&](const Source& row) {
      const std::uint8_t* const used = from_.used->row(row.camera);
      if (straight_)
        return std::memchr(used + columns_[block.x].camera, 1,
                           static_cast<std::size_t>(block.width)) != nullptr;
      return std::ranges::any_of(columns_in(block),
                                 [&](const Source& column) { return used[column.camera] != 0; });
    });
  }

  /// Draws a part of the tile. `used`: pixels outside this mask stay black; null: draws all.
  void draw(const ImageRgb& picture, const ImageMask* used, const Rect& part) const {
    for (int y = part.y; y < part.y + part.height; ++y) {
      const Source& row = rows_[y];
      std::uint8_t* const out = atlas_.at(at_.x + part.x, at_.y + y);
      if (straight_ && row.share == 0 && !used)
        std::copy_n(picture.at(columns_[part.x].first, row.first), 3 * part.width, out);
      else
        draw_row(picture, columns_in(part), row, used ? used->row(row.camera) : nullptr, out);
    }
  }

  std::span<const Source> columns_in(const Rect& part) const {
    return std::span(columns_).subspan(part.x, part.width);
  }
  std::span<const Source> rows_in(const Rect& part) const {
    return std::span(rows_).subspan(part.y, part.height);
  }

  Rect at_;
  const TileSources& from_;
  std::vector<Source> columns_, rows_;
  bool straight_;  ///< columns of the picture are columns of the tile
  ImageRgb& atlas_;
};

}  // namespace

ImageMask used_pixels(const Mesh& mesh, const View& view, int margin_px) {
  ImageMask mask(view.width, view.height);
  if (view.kind != View::Kind::pinhole) {
    std::fill(mask.data.begin(), mask.data.end(), 1);
    return mask;
  }
  const Camera camera = view.camera();
  const Pose T_camera_world = view.T_world_camera.inverse();
  for (const ViewRun& run : mesh.views) {
    if (run.id != view.id) continue;
    for (std::uint32_t t = run.first; t < run.first + run.count; ++t) {
      const auto corner = [&](int i) {
        return T_camera_world * vec_cast<double>(mesh.corner(t, i));
      };
      const std::array<Vec3d, 3> corners = {corner(0), corner(1), corner(2)};
      kit::scan_polygon(kit::clip_to_screen(camera, corners), camera.width, 0, camera.height,
                        [&](const kit::ScreenSpan& s) {
                          std::fill(mask.at(s.first, s.y), mask.at(s.last, s.y) + 1, 1);
                        });
      for (const Vec3d& c : corners) {  // slivers cover no pixel centre
        const kit::ScreenPoint s = kit::to_screen(camera, c);
        const int x = static_cast<int>(std::lround(s.u)), y = static_cast<int>(std::lround(s.v));
        if (c.z > kit::kNearPlane_m && mask.contains(x, y)) *mask.at(x, y) = 1;
      }
    }
  }
  const auto either = [](std::uint8_t a, std::uint8_t b) {
    return static_cast<std::uint8_t>(a | b);
  };
  return reduce_neighbourhood(mask, margin_px, std::uint8_t{0}, either);
}

ImageRgb compose_atlas(const Layout& layout, const AtlasSources& from, ImageRgb memory) {
  ImageRgb atlas = std::move(memory);
  atlas.width = layout.width, atlas.height = layout.height;
  atlas.data.assign(std::size_t{3} * layout.width * layout.height, 0);
  for (const View& tile : layout.views) {
    const auto child = from.children.find(tile.id);
    if (child == from.children.end()) continue;
    const auto picture = from.pictures.find(child->second.stream);
    if (picture == from.pictures.end() || !picture->second) continue;
    const auto used = from.used.find(tile.id);
    const auto back = from.behind.find(tile.id);
    const bool has_back = back != from.behind.end() &&
                          back->second->width == picture->second->width &&
                          back->second->height == picture->second->height;
    const TileSources sources{*picture->second, used == from.used.end() ? nullptr : &used->second,
                              from.mask, has_back ? back->second : nullptr};
    TileDrawer(tile, child->second, sources, atlas).draw();
  }
  return atlas;
}

namespace {

/// Makes blocks uniform whose used pixels are all 0 or all 1.
void simplify(Alpha& alpha, const View& view, const ImageMask& used) {
  constexpr int kAlphaBlock_px = AlphaPlane::kBlock_px;
  constexpr std::uint8_t kZeros = 1, kOnes = 2;
  ImageMask& plane = alpha.plane;
  std::vector<int> column(used.width);
  for (int x = 0; x < used.width; ++x) column[x] = alpha.column(stream_pixel(view, {x + 0.0, 0}).x);
  ImageMask values((plane.width + kAlphaBlock_px - 1) / kAlphaBlock_px,
                   (plane.height + kAlphaBlock_px - 1) / kAlphaBlock_px);
  for (int y = 0; y < used.height; ++y) {
    const int row = alpha.row(stream_pixel(view, {0, y + 0.0}).y);
    for (int x = 0; x < used.width; ++x)
      if (*used.at(x, y))
        *values.at(column[x] / kAlphaBlock_px, row / kAlphaBlock_px) |=
            *plane.at(column[x], row) ? kOnes : kZeros;
  }
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x)
      if (const std::uint8_t v = *values.at(x / kAlphaBlock_px, y / kAlphaBlock_px);
          v != (kZeros | kOnes))
        *plane.at(x, y) = v != kZeros;
}

/// Draws the tile of a plane, from the plane of its child.
void draw_tile(const View& tile, const View& child, const Alpha& from, Alpha& out) {
  const Rect& at = tile.atlas_rect;
  const auto middle = [&](int i) { return (i + 0.5) * out.step_px - 0.5; };
  const auto first = [&](int pixel) { return (pixel + out.step_px / 2) / out.step_px; };
  std::vector<int> columns;
  for (int x = first(at.x); middle(x) < at.x + at.width - 0.5; ++x)
    columns.push_back(from.column(stream_pixel(child, camera_pixel(tile, {middle(x), 0})).x));
  for (int y = first(at.y); middle(y) < at.y + at.height - 0.5; ++y) {
    const int row = from.row(stream_pixel(child, camera_pixel(tile, {0, middle(y)})).y);
    std::ranges::transform(columns, out.plane.at(first(at.x), y),
                           [&](int column) { return *from.plane.at(column, row); });
  }
}

}  // namespace

std::optional<Alpha> compose_alpha(const Layout& layout, const AlphaSources& sources) {
  constexpr int kStep_px = AlphaPlane::kStep_px;
  Alpha out{kStep_px, ImageMask((layout.width + kStep_px - 1) / kStep_px,
                                (layout.height + kStep_px - 1) / kStep_px, 1)};
  for (const View& tile : layout.views) {
    const auto child = sources.children.find(tile.id);
    if (child == sources.children.end()) continue;
    const auto found = sources.planes.find(child->second.stream);
    if (found == sources.planes.end()) continue;
    Alpha from = *found->second;
    if (const auto used = sources.used.find(tile.id); used != sources.used.end())
      simplify(from, child->second, used->second);
    draw_tile(tile, child->second, from, out);
  }
  if (std::ranges::count(out.plane.data, 0) == 0) return std::nullopt;
  return out;
}

}  // namespace mr::atlas
