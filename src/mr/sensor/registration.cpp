#include "mr/sensor/registration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "mr/core/parallel.h"

namespace mr::sensor {
namespace {

constexpr Vec2f kNowhere{-1, -1};
constexpr std::size_t kRowsAtOnce = 16;

bool needs_undistortion(const Camera& camera) {
  return camera.model == CameraModel::pinhole && camera.distortion != DistortionModel::none;
}

bool has_size_of(const auto& image, const Camera& camera) {
  return image.width == camera.width && image.height == camera.height;
}

/// Where each pixel of the undistorted camera lies in the picture as taken; kNowhere outside it.
std::vector<Vec2f> source_positions(const Camera& camera, const Camera& straight) {
  std::vector<Vec2f> map(static_cast<std::size_t>(camera.width) * camera.height, kNowhere);
  parallel_for(camera.height, kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y)
      for (int x = 0; x < camera.width; ++x) {
        const Vec2d pixel{static_cast<double>(x), static_cast<double>(y)};
        const auto p = project(camera, unproject(straight, pixel));
        if (!p || p->x < -0.5 || p->y < -0.5 || p->x >= camera.width - 0.5 ||
            p->y >= camera.height - 0.5)
          continue;
        map[y * camera.width + x] = {static_cast<float>(p->x), static_cast<float>(p->y)};
      }
  });
  return map;
}

/// The same as the index of the nearest source pixel; -1 outside.
std::vector<std::int32_t> nearest_pixels(const Camera& camera, const Camera& straight) {
  const std::vector<Vec2f> positions = source_positions(camera, straight);
  std::vector<std::int32_t> map(positions.size(), -1);
  for (std::size_t i = 0; i < map.size(); ++i) {
    if (positions[i] == kNowhere) continue;
    const int x = std::clamp(static_cast<int>(std::lround(positions[i].x)), 0, camera.width - 1);
    const int y = std::clamp(static_cast<int>(std::lround(positions[i].y)), 0, camera.height - 1);
    map[i] = y * camera.width + x;
  }
  return map;
}

ImageDepth remap_depth(const ImageDepth& from, const std::vector<std::int32_t>& map) {
  ImageDepth to(from.width, from.height);
  for (std::size_t i = 0; i < map.size(); ++i)
    if (map[i] >= 0) to.data[i] = from.data[map[i]];
  return to;
}

ImageRgb remap_color(const ImageRgb& from, const std::vector<Vec2f>& map) {
  ImageRgb to(from.width, from.height);
  const Rect whole{0, 0, from.width, from.height};
  parallel_for(from.height, kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin * from.width; i < end * from.width; ++i)
      if (map[i] != kNowhere)
        std::ranges::copy(sample_bilinear(from, whole, map[i].x, map[i].y), &to.data[i * 3]);
  });
  return to;
}

/// A large rectangle without uncovered pixels: the whole picture, with the side that has the
/// largest share of them pushed in until none is left.
Rect covered_rect(const std::vector<Vec2f>& map, int width, int height) {
  int left = 0, top = 0, right = width, bottom = height;
  const auto missing = [&](int x0, int y0, int x1, int y1) {
    int count = 0;
    for (int y = y0; y < y1; ++y)
      for (int x = x0; x < x1; ++x)
        count += map[static_cast<std::size_t>(y) * width + x] == kNowhere;
    return static_cast<double>(count) / std::max(1, (x1 - x0) * (y1 - y0));
  };
  while (left < right && top < bottom) {
    const std::array<double, 4> share = {
        missing(left, top, left + 1, bottom), missing(right - 1, top, right, bottom),
        missing(left, top, right, top + 1), missing(left, bottom - 1, right, bottom)};
    const auto worst = std::max_element(share.begin(), share.end());
    if (*worst == 0) break;
    switch (worst - share.begin()) {
      case 0:
        ++left;
        break;
      case 1:
        --right;
        break;
      case 2:
        ++top;
        break;
      default:
        --bottom;
    }
  }
  return {left, top, right - left, bottom - top};
}

}  // namespace

Registration::Registration(const SensorConfig& sensor, SensorId id)
    : id_(id),
      depth_camera_(undistorted_whole(sensor.depth_camera)),
      T_depth_color_(sensor.T_color_depth.inverse()) {
  if (needs_undistortion(sensor.depth_camera))
    depth_map_ = nearest_pixels(sensor.depth_camera, depth_camera_);
  if (!sensor.color_camera) return;
  color_camera_ = undistorted(*sensor.color_camera);
  color_rect_ = {0, 0, color_camera_->width, color_camera_->height};
  if (!needs_undistortion(*sensor.color_camera)) return;
  color_map_ = source_positions(*sensor.color_camera, *color_camera_);
  color_rect_ = covered_rect(color_map_, color_camera_->width, color_camera_->height);
}

Frame Registration::undistort(Frame frame) const {
  if (!depth_map_.empty() && !frame.depth.empty()) {
    MR_ASSERT(has_size_of(frame.depth, depth_camera_));
    frame.depth = remap_depth(frame.depth, depth_map_);
  }
  if (!color_map_.empty() && !frame.color.empty()) {
    MR_ASSERT(has_size_of(frame.color, *color_camera_));
    frame.color = remap_color(frame.color, color_map_);
  }
  return frame;
}

std::optional<View> Registration::color_view(const Pose& T_world_depth) const {
  if (!color_camera_) return std::nullopt;
  const Camera& camera = *color_camera_;
  View view;
  view.id = view_of(id_);
  view.kind = camera.model == CameraModel::equirectangular ? View::Kind::equirectangular
                                                           : View::Kind::pinhole;
  view.width = camera.width, view.height = camera.height;
  view.fx = camera.fx, view.fy = camera.fy, view.cx = camera.cx, view.cy = camera.cy;
  view.T_world_camera = T_world_depth * T_depth_color_;
  view.image_rect = view.atlas_rect = color_rect_;
  return view;
}

}  // namespace mr::sensor
