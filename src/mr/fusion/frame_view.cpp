#include "mr/fusion/frame_view.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mr/fusion/voxel_volume.h"

namespace mr::fusion {
namespace {

using std::numbers::pi;
constexpr double kFarthestPlace_m = 1e6;

double per_block(const VolumeConfig& config) { return 1 / (config.voxel_m * VoxelBlock::kSide); }

/// Sets the voxel → (U, V, Z) map; `form`: linear map from camera points to (U, V, Z).
template <typename Form>
void set_projection(const Pose& T_camera_world, double voxel_m, const Form& form, FrameView& view) {
  view.origin = form(T_camera_world.translation);
  for (int i = 0; i < 3; ++i) view.axis[i] = form(T_camera_world.rotation.column(i)) * voxel_m;
  for (int i = 0; i < 64; ++i) {
    const Vec3f d = vec_cast<float>(view.axis[0] * (i % 8) + view.axis[1] * (i / 8));
    view.dU[i] = d.x, view.dV[i] = d.y, view.dZ[i] = d.z;
  }
}

void set_pinhole(const DepthFrame& frame, const VolumeConfig& config, FrameView& view) {
  const Camera& c = frame.camera;
  const Rect& region = frame.region;
  const auto column = [&](int i) {
    return frame.T_world_camera.rotation.column(i) * per_block(config);
  };
  for (int x = 0; x < region.width; ++x)
    view.s[x] = static_cast<float>((region.x + x - c.cx) / c.fx);
  for (int y = 0; y < region.height; ++y)
    view.ray[y] = {vec_cast<float>(column(2) + column(1) * ((region.y + y - c.cy) / c.fy)),
                   vec_cast<float>(column(0)), Vec3f{}};
  view.per_pixel = {static_cast<float>(1 / c.fx), static_cast<float>(1 / c.fy)};
  view.down_per_pixel = vec_cast<float>(column(1) * (1 / c.fy));
  view.first_row = static_cast<float>((region.y - c.cy) / c.fy);
  // + 1 for the border column and row: rounding then gives the index in `depth`.
  const double cx = c.cx - region.x + 1, cy = c.cy - region.y + 1;
  set_projection(
      frame.T_world_camera.inverse(), config.voxel_m,
      [&](Vec3d p) {
        return Vec3d{c.fx * p.x + cx * p.z, c.fy * p.y + cy * p.z, p.z};
      },
      view);
}

/// Each row's angle below the horizon and its azimuth offset to the right.
void set_rows(const DepthFrame& frame, FrameView& view) {
  const Camera& c = frame.camera;
  const bool lidar = c.model == CameraModel::lidar;
  view.row_down.assign(view.height + 2, 0);
  view.row_right.assign(view.height + 2, 0);
  for (int y = 0; y < view.height; ++y) {
    const int row = frame.region.y + y;
    view.row_down[y + 1] =
        static_cast<float>(lidar ? -c.beam_altitude_rad[row] : ((row + 0.5) / c.height - 0.5) * pi);
    view.row_right[y + 1] = static_cast<float>(lidar ? c.beam_azimuth_rad[row] : 0);
  }
}

/// Lookup table from elevation to the nearest row; none beyond half a row gap outside the outermost
/// rows.
void set_row_bins(FrameView& view) {
  std::vector<int> by_angle(view.height);
  for (int y = 0; y < view.height; ++y) by_angle[y] = y;
  const auto down = [&](int y) { return static_cast<double>(view.row_down[y + 1]); };
  std::sort(by_angle.begin(), by_angle.end(),
            [&](int a, int b) { return std::pair(down(a), a) < std::pair(down(b), b); });
  const double gap = view.height < 2
                         ? pi / 180
                         : (down(by_angle.back()) - down(by_angle.front())) / (view.height - 1);
  const int bins = std::max(4096, 8 * view.height);
  view.bins_per_rad = static_cast<float>(bins / pi);
  view.row_at.assign(bins + 1, 0);
  std::size_t nearest = 0;
  for (int b = 0; b <= bins; ++b) {
    const double angle = (b + 0.5) / bins * pi - pi / 2;
    const auto off = [&](std::size_t i) { return std::abs(down(by_angle[i]) - angle); };
    while (nearest + 1 < by_angle.size() && off(nearest + 1) <= off(nearest)) ++nearest;
    const bool between = angle > down(by_angle.front()) && angle < down(by_angle.back());
    if (between || off(nearest) <= gap / 2) view.row_at[b] = by_angle[nearest] + 1;
  }
}

void set_spherical(const DepthFrame& frame, const VolumeConfig& config, FrameView& view) {
  const Rect& region = frame.region;
  set_rows(frame, view);
  set_row_bins(view);
  view.wraps = region.width == frame.camera.width;
  view.columns_per_rad = static_cast<float>(frame.camera.width / (2 * pi));
  view.first_column = static_cast<float>(frame.camera.width / 2.0 - region.x);
  view.down_axis = vec_cast<float>(frame.T_world_camera.rotation.column(1) * per_block(config));
  const auto column = [&](int i) {
    return frame.T_world_camera.rotation.column(i) * per_block(config);
  };
  for (int x = 0; x < region.width; ++x) {
    const double right = ((region.x + x + 0.5) / frame.camera.width - 0.5) * 2 * pi;
    view.s[x] = static_cast<float>(std::sin(right)),
    view.t[x] = static_cast<float>(std::cos(right));
  }
  for (int y = 0; y < region.height; ++y) {
    const double down = view.row_down[y + 1], right = view.row_right[y + 1];
    const Vec3d ahead =
        (column(0) * std::sin(right) + column(2) * std::cos(right)) * std::cos(down);
    const Vec3d aside =
        (column(0) * std::cos(right) - column(2) * std::sin(right)) * std::cos(down);
    view.ray[y] = {vec_cast<float>(column(1) * std::sin(down)), vec_cast<float>(aside),
                   vec_cast<float>(ahead)};
  }
  set_projection(
      frame.T_world_camera.inverse(), config.voxel_m, [](Vec3d p) { return p; }, view);
}

bool usable(const DepthFrame& frame) {
  const Rect& r = frame.region;
  const Pose& T = frame.T_world_camera;
  if (!frame.camera.problems().empty() || r.empty()) return false;
  if (frame.camera.distortion != DistortionModel::none) return false;
  if (r.x < 0 || r.y < 0 || r.x > frame.depth.width - r.width ||
      r.y > frame.depth.height - r.height)
    return false;
  if (frame.camera.width != frame.depth.width || frame.camera.height != frame.depth.height)
    return false;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      if (!(std::abs(dot(T.rotation.column(a), T.rotation.column(b)) - (a == b)) < 1e-3))
        return false;
  return length(T.translation) < kFarthestPlace_m;
}

}  // namespace

bool set_frame(const DepthFrame& frame, const VolumeConfig& config, FrameView& view) {
  if (!usable(frame)) return false;
  const Rect& region = frame.region;
  view.width = region.width, view.height = region.height;
  view.stride = (region.width + 2 + 15) / 16 * 16 + FrameView::kPadding;
  view.depth.resize(static_cast<std::size_t>(view.stride) * (region.height + 2));
  std::fill_n(view.depth.begin(), view.stride, FrameView::kNothing);
  std::fill_n(view.depth.end() - view.stride, view.stride, FrameView::kNothing);
  const Vec3d eye = frame.T_world_camera.translation * per_block(config);
  view.eye_block = {static_cast<std::int32_t>(std::floor(eye.x)),
                    static_cast<std::int32_t>(std::floor(eye.y)),
                    static_cast<std::int32_t>(std::floor(eye.z))};
  view.eye = vec_cast<float>(eye - vec_cast<double>(view.eye_block));
  view.s.assign(region.width + FrameView::kPadding, 0);
  view.t.assign(region.width + FrameView::kPadding, 0);
  view.ray.resize(region.height);
  view.spherical = frame.camera.model != CameraModel::pinhole;
  view.slanted = frame.slanted && !view.spherical;
  view.wraps = false;
  if (view.spherical)
    set_spherical(frame, config, view);
  else
    set_pinhole(frame, config, view);
  view.truncation_m = static_cast<float>(config.truncation_m);
  view.least_band_m = static_cast<float>(1.5 * config.voxel_m);
  view.precision = frame.precision;
  view.pixel_rad =
      static_cast<float>(view.spherical ? 2 * pi / frame.camera.width
                                        : 1 / std::min(frame.camera.fx, frame.camera.fy));
  view.bounds.reset();
  if (config.bounds) {
    const Vec3d corner = vec_cast<double>(view.eye_block);
    view.bounds = Box3f{vec_cast<float>(config.bounds->low * per_block(config) - corner),
                        vec_cast<float>(config.bounds->high * per_block(config) - corner)};
  }
  return true;
}

}  // namespace mr::fusion
