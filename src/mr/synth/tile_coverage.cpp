#include "mr/synth/tile_coverage.h"

#include <algorithm>
#include <cmath>

namespace mr::synth {
namespace {

constexpr double kMargin_px = 2;

/// Positions in the picture; x is NaN where a vertex cannot be seen.
std::vector<Vec2d> projected(const Mesh& mesh, const PosedCamera& eye) {
  const Pose T_camera_world = eye.T_world_camera.inverse();
  std::vector<Vec2d> out(mesh.positions.size());
  parallel_for(out.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const auto p = project(eye.camera, T_camera_world * vec_cast<double>(mesh.positions[v]));
      out[v] = p.value_or(Vec2d{std::nan(""), 0});
    }
  });
  return out;
}

}  // namespace

TileCoverage::TileCoverage(int width, int height)
    : width_(width),
      height_(height),
      columns_((width + kTile - 1) / kTile),
      rows_((height + kTile - 1) / kTile),
      marks_(static_cast<std::size_t>(columns_) * rows_) {}

void TileCoverage::mark(Vec2d low, Vec2d high) {
  const auto tile = [](double v, int size) {
    return static_cast<int>(std::clamp(v, -1.0, static_cast<double>(size))) / kTile;
  };
  if (high.x < 0 || high.y < 0 || low.x >= width_ || low.y >= height_) return;
  const int x0 = tile(std::max(low.x, 0.0), width_), y0 = tile(std::max(low.y, 0.0), height_);
  const int x1 = std::min(tile(high.x, width_), columns_ - 1);
  const int y1 = std::min(tile(high.y, height_), rows_ - 1);
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x) marks_[static_cast<std::size_t>(y) * columns_ + x] = 1;
}

void TileCoverage::add(const Mesh& mesh, const PosedCamera& eye) {
  const std::vector<Vec2d> at = projected(mesh, eye);
  const bool wraps_around = eye.camera.model != CameraModel::pinhole;
  for (const Triangle& t : mesh.triangles) {
    const Vec2d a = at[t[0]], b = at[t[1]], c = at[t[2]];
    const int unseen = std::isnan(a.x) + std::isnan(b.x) + std::isnan(c.x);
    if (unseen == 3) continue;
    Vec2d low{std::min({a.x, b.x, c.x}) - kMargin_px, std::min({a.y, b.y, c.y}) - kMargin_px};
    Vec2d high{std::max({a.x, b.x, c.x}) + kMargin_px, std::max({a.y, b.y, c.y}) + kMargin_px};
    if (wraps_around && high.x - low.x > 0.5 * width_) low.x = 0, high.x = width_;
    if (wraps_around && low.x < 0)
      mark({width_ + low.x, low.y}, {static_cast<double>(width_), high.y});
    if (wraps_around && high.x >= width_) mark({0, low.y}, {high.x - width_, high.y});
    if (unseen > 0)  // reaches behind the camera
      low = {0, 0}, high = {static_cast<double>(width_), static_cast<double>(height_)};
    mark(low, high);
  }
}

void TileCoverage::add(const TileCoverage& other) {
  MR_ASSERT(other.marks_.size() == marks_.size());
  for (std::size_t i = 0; i < marks_.size(); ++i) marks_[i] |= other.marks_[i];
}

void TileCoverage::for_tiles(const std::function<void(Rect)>& body) const {
  parallel_for(rows_, 1, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < columns_; ++x)
        if (marks_[static_cast<std::size_t>(y) * columns_ + x] != 0)
          body({x * kTile, y * kTile, std::min(kTile, width_ - x * kTile),
                std::min(kTile, height_ - y * kTile)});
  });
}

void TileCoverage::for_runs(const std::function<void(int, int, int)>& body) const {
  for (int y = 0; y < height_; ++y) {
    const std::uint8_t* row = marks_.data() + static_cast<std::size_t>(y / kTile) * columns_;
    for (int x = 0; x < columns_; ++x) {
      const int begin = x;
      while (x < columns_ && row[x] != 0) ++x;
      if (x > begin) body(y, begin * kTile, std::min(x * kTile, width_));
    }
  }
}

}  // namespace mr::synth
