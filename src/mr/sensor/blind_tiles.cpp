#include "mr/sensor/blind_tiles.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace mr::sensor {
namespace {

/// The depth from which a ray is inside a box: 0 if it begins there or misses the box. `direction`
/// gains 1 m of depth.
float entry_depth(const Box3d& box, Vec3d from, Vec3d direction) {
  double in = 0, out = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (box.low[axis] - from[axis]) / direction[axis],
                 b = (box.high[axis] - from[axis]) / direction[axis];
    if (std::isnan(a) || std::isnan(b)) continue;  // along a side of the box
    in = std::max(in, std::min(a, b)), out = std::min(out, std::max(a, b));
  }
  return in < out ? static_cast<float>(in) : 0;
}

/// The tiles that are not in a mask, nor beside one that is.
TileMask far_from(const TileMask& mask) {
  TileMask out = mask;
  for (int row = 0; row < mask.rows; ++row)
    for (int column = 0; column < mask.columns; ++column) {
      bool any = false;
      for (int y = std::max(row - 1, 0); y <= std::min(row + 1, mask.rows - 1); ++y)
        for (int x = std::max(column - 1, 0); x <= std::min(column + 1, mask.columns - 1); ++x)
          any |= mask.at(x, y);
      out.tiles[static_cast<std::size_t>(row) * mask.columns + column] = !any;
    }
  return out;
}

}  // namespace

TileMask tiles_in_depth(const Camera& depth, const Camera& color, const Pose& T_depth_color,
                        int tile_px, NearAndFar wanted) {
  const auto sees = [&](Vec2d pixel, double depth_m) {
    const auto p = project(depth, T_depth_color * (unproject(color, pixel) * depth_m));
    return p && p->x >= 0 && p->y >= 0 && p->x <= depth.width - 1 && p->y <= depth.height - 1;
  };
  TileMask out{
      tile_px, (color.width + tile_px - 1) / tile_px, (color.height + tile_px - 1) / tile_px, {}};
  for (int row = 0; row < out.rows; ++row)
    for (int column = 0; column < out.columns; ++column) {
      const Vec2d middle{(column + 0.5) * tile_px, (row + 0.5) * tile_px};
      const int seen = sees(middle, 1) + sees(middle, 2) + sees(middle, 8);
      out.tiles.push_back(wanted == NearAndFar::both ? seen == 3 : seen > 0);
    }
  return out;
}

BlindTiles::BlindTiles(const Camera& depth_camera, const Camera& color_camera,
                       const Pose& T_color_depth, const ReconstructedSpace& space)
    : depth_camera_(depth_camera),
      color_camera_(color_camera),
      T_color_depth_(T_color_depth),
      space_(space),
      beyond_(far_from(tiles_in_depth(depth_camera, color_camera, T_color_depth.inverse(), kTile_px,
                                      NearAndFar::either))) {
  if (depth_camera.model != CameraModel::pinhole || color_camera.model != CameraModel::pinhole)
    return;
  // Pixels that a tile's side has in the depth picture: some four are enough to judge by.
  const double side_px =
      kTile_px * std::min(depth_camera.fx / color_camera.fx, depth_camera.fy / color_camera.fy);
  step_px_ = side_px < 1 ? 0 : std::max(static_cast<int>(side_px / 4), 1);
}

/// Calls `f` with every sample that the colour picture shows.
template <typename F>
void BlindTiles::each_sample(const ImageDepth& measured, const ImageDepth& cleaned,
                             const ImageMask* of, const Pose& T_world_depth, const F& f) const {
  const Vec3f t = vec_cast<float>(T_color_depth_.translation);
  const auto fx = static_cast<float>(color_camera_.fx), fy = static_cast<float>(color_camera_.fy);
  const auto cx = static_cast<float>(color_camera_.cx), cy = static_cast<float>(color_camera_.cy);
  const Vec3d eye = T_world_depth.translation;
  const double floor_m = space_.floor
                             ? space_.floor->height_m + space_.floor->margin_m - dot(space_.up, eye)
                             : -std::numeric_limits<double>::infinity();  // above the camera
  for (int y = 0; y < measured.height; y += step_px_)
    for (int x = 0; x < measured.width; x += step_px_) {
      const float z = *measured.at(x, y);
      if (!(z > 0)) continue;
      const Vec3d ray{(x - depth_camera_.cx) / depth_camera_.fx,
                      (y - depth_camera_.cy) / depth_camera_.fy, 1};
      const Vec3f p = vec_cast<float>(T_color_depth_.rotation * ray) * z + t;
      if (!(p.z > 0)) continue;
      const float u = fx * p.x / p.z + cx + 0.5f, v = fy * p.y / p.z + cy + 0.5f;
      if (!(u >= 0 && v >= 0 && u < static_cast<float>(color_camera_.width) &&
            v < static_cast<float>(color_camera_.height)))
        continue;
      const bool is_cleaned = (!of || *of->at(x, y)) && !(*cleaned.at(x, y) > 0);
      const Vec3d direction = T_world_depth.rotation * ray;
      const bool is_before = space_.volume && z < entry_depth(*space_.volume, eye, direction);
      const bool is_floor = dot(space_.up, direction) * z < floor_m;
      f(Sample{static_cast<int>(v) / kTile_px * beyond_.columns + static_cast<int>(u) / kTile_px, z,
               is_floor || (!is_cleaned && !is_before)});
    }
}

/// Adds the tiles in which something that is not reconstructed hides what is; clears others that
/// show what is: nearer than the depths that `beyond_` is for, the depth picture reaches farther.
void BlindTiles::add_hidden(const ImageDepth& measured, const ImageDepth& cleaned,
                            const ImageMask* of, const Pose& T_world_depth, TileMask& blind) const {
  constexpr float kFront_m = 0.05f, kFrontShare = 0.02f;
  struct Tile {
    float nearest_made = std::numeric_limits<float>::infinity();
    int samples = 0, hiding = 0;
  };
  std::vector<Tile> tiles(blind.tiles.size());
  std::vector<Sample> unmade;
  each_sample(measured, cleaned, of, T_world_depth, [&](const Sample& sample) {
    Tile& tile = tiles[sample.tile];
    ++tile.samples;
    if (sample.is_made)
      tile.nearest_made = std::min(tile.nearest_made, sample.z);
    else
      unmade.push_back(sample);
  });
  for (const Sample& sample : unmade) {
    Tile& tile = tiles[sample.tile];
    tile.hiding += sample.z < tile.nearest_made - kFront_m - kFrontShare * sample.z;
  }
  for (std::size_t i = 0; i < tiles.size(); ++i)
    if (2 * tiles[i].hiding > tiles[i].samples)
      blind.tiles[i] = 1;
    else if (std::isfinite(tiles[i].nearest_made))
      blind.tiles[i] = 0;
}

TileMask BlindTiles::blind(const ImageDepth& measured, const ImageDepth& cleaned,
                           const ImageMask* of, const Pose& T_world_depth) const {
  TileMask out = beyond_;
  if (step_px_ > 0) add_hidden(measured, cleaned, of, T_world_depth, out);
  return out;
}

}  // namespace mr::sensor
