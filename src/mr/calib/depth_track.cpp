#include "mr/calib/depth_track.h"

#include <algorithm>
#include <cmath>

#include "mr/core/assert.h"

namespace mr::calib {
namespace {

constexpr int kNormalReach_px = 2;    // neighbours that normals come from
constexpr double kMostBend_m = 0.02;  // of a surface between these, plus four times the noise
constexpr double kMostRise_m = 0.06;  // between a pixel and such a neighbour
constexpr double kLeastTrackFacing = 0.35;
constexpr double kMostCaptureStep_m = 0.08;  // between successive pictures
constexpr double kMostCaptureGap_s = 0.1;    // likewise
constexpr std::size_t kLeastReadings = 5;

/// The mean of those readings that lie around the one that three in ten are beyond: whatever moves
/// stands in front. Sorts.
float background_depth(std::vector<float>& readings, const Precision& precision) {
  if (readings.size() < kLeastReadings) return 0;
  std::ranges::sort(readings);
  const double middle_m = readings[readings.size() * 7 / 10];
  const double reach_m = 0.005 + 4 * precision.sigma_m(middle_m);
  double sum = 0;
  int count = 0;
  for (const double reading : readings)
    if (std::abs(reading - middle_m) <= reach_m) sum += reading, ++count;
  return static_cast<float>(sum / count);
}

ImageDepth background_of(const DepthTrack& track, int most_frames) {
  const std::size_t frames = track.depth.size();
  const std::size_t used = std::min(frames, static_cast<std::size_t>(most_frames));
  ImageDepth out(track.camera.width, track.camera.height);
  std::vector<float> readings;
  for (std::size_t i = 0; i < out.data.size(); ++i) {
    readings.clear();
    for (std::size_t k = 0; k < used; ++k)
      if (const auto count = track.depth[k * frames / used].data[i]; count > 0)
        readings.push_back(static_cast<float>(count * DepthTrack::kCount_m));
    out.data[i] = background_depth(readings, track.precision);
  }
  return out;
}

/// Where a pixel's surface lies and how it is inclined; depth camera.
struct PixelSurface {
  Vec3d point, normal;
};

/// None beside jumps and sharp bends, and where seen at a grazing angle. `depth_at(x, y)`: metres.
template <typename DepthAt>
std::optional<PixelSurface> pixel_surface(const DepthTrack& track, int x, int y,
                                          const DepthAt& depth_at) {
  const Camera& camera = track.camera;
  const int a = kNormalReach_px;
  if (x < a || y < a || x >= camera.width - a || y >= camera.height - a) return std::nullopt;
  const double z = depth_at(x, y);
  if (!(z > 0)) return std::nullopt;
  const double most_bend_m = kMostBend_m + 4 * track.precision.sigma_m(z);
  const auto smooth = [&](double before, double after) {
    return before > 0 && after > 0 && std::abs(before - z) < kMostRise_m &&
           std::abs(after - z) < kMostRise_m && std::abs(before + after - 2 * z) < most_bend_m;
  };
  const double left = depth_at(x - a, y), right = depth_at(x + a, y), up = depth_at(x, y - a),
               down = depth_at(x, y + a);
  if (!smooth(left, right) || !smooth(up, down)) return std::nullopt;
  const auto point = [&](int i, int j, double depth) {
    return Vec3d{(i - camera.cx) / camera.fx, (j - camera.cy) / camera.fy, 1} * depth;
  };
  const Vec3d p = point(x, y, z);
  Vec3d n = normalized(cross(point(x, y + a, down) - point(x, y - a, up),
                             point(x + a, y, right) - point(x - a, y, left)));
  if (dot(n, p) > 0) n = -n;
  if (-dot(n, p) < kLeastTrackFacing * length(p)) return std::nullopt;
  return PixelSurface{p, n};
}

double seconds(Duration d) { return std::chrono::duration<double>(d).count(); }

/// The points of picture `k`, which has one before and one after it.
void add_moving(const DepthTrack& track, std::size_t k, double time_s, const ImageDepth& background,
                const TrackSurfaceConfig& config, std::vector<MovingPoint>& points) {
  const double span_s = seconds(track.times[k + 1] - track.times[k - 1]);
  const ImageCounts &before = track.depth[k - 1], &now = track.depth[k],
                    &after = track.depth[k + 1];
  const auto depth_at = [&](int x, int y) { return *now.at(x, y) * DepthTrack::kCount_m; };
  std::vector<MovingPoint> found;
  for (int y = 0; y < now.height; ++y)
    for (int x = 0; x < now.width; ++x) {
      const double z = depth_at(x, y), behind = *background.at(x, y);
      if (!(z > 0) || !(z < behind - config.least_step_m - 4 * track.precision.sigma_m(behind)))
        continue;
      const double z0 = *before.at(x, y) * DepthTrack::kCount_m,
                   z1 = *after.at(x, y) * DepthTrack::kCount_m;
      if (!(z0 > 0 && z1 > 0) || std::abs(z0 - z) > kMostCaptureStep_m ||
          std::abs(z1 - z) > kMostCaptureStep_m)
        continue;
      const auto surface = pixel_surface(track, x, y, depth_at);
      if (!surface) continue;
      const double along_ray = dot(surface->normal, surface->point) / z;
      found.push_back({time_s, track.T_world_depth * surface->point,
                       track.T_world_depth.rotation * surface->normal,
                       (z1 - z0) / span_s * along_ray});
    }
  const std::size_t most = static_cast<std::size_t>(config.most_moving);
  const std::size_t kept = std::min(found.size(), most);
  for (std::size_t i = 0; i < kept; ++i) points.push_back(found[i * found.size() / kept]);
}

void add_resting(const DepthTrack& track, const ImageDepth& background, int step_px,
                 std::vector<MovingPoint>& points) {
  const auto depth_at = [&](int x, int y) { return static_cast<double>(*background.at(x, y)); };
  for (int y = 0; y < background.height; y += step_px)
    for (int x = 0; x < background.width; x += step_px)
      if (const auto surface = pixel_surface(track, x, y, depth_at))
        points.push_back({0, track.T_world_depth * surface->point,
                          track.T_world_depth.rotation * surface->normal, 0});
}

}  // namespace

std::size_t DepthTrack::bytes() const {
  std::size_t sum = 0;
  for (const ImageCounts& picture : depth) sum += picture.data.size() * sizeof(std::uint16_t);
  return sum;
}

DepthTrack make_depth_track(const Camera& camera, const Pose& T_world_depth,
                            const Precision& precision) {
  MR_ASSERT(camera.model == CameraModel::pinhole && camera.distortion == DistortionModel::none);
  DepthTrack track;
  track.camera = camera, track.T_world_depth = T_world_depth, track.precision = precision;
  const auto kept = [&](int side) { return (side + track.step_px - 1) / track.step_px; };
  while (kept(camera.width) * kept(camera.height) > DepthTrack::kMostPixels) ++track.step_px;
  const double step = track.step_px;
  track.camera.width = kept(camera.width), track.camera.height = kept(camera.height);
  track.camera.fx /= step, track.camera.fy /= step;
  track.camera.cx /= step, track.camera.cy /= step;
  return track;
}

bool append(DepthTrack& track, TimePoint captured_at, const ImageDepth& depth) {
  if (!track.times.empty() && captured_at <= track.times.back()) return false;
  const int step = track.step_px;
  ImageCounts picture(track.camera.width, track.camera.height);
  MR_ASSERT((depth.width + step - 1) / step == picture.width &&
            (depth.height + step - 1) / step == picture.height);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const double count = std::floor(*depth.at(x * step, y * step) / DepthTrack::kCount_m + 0.5);
      if (count > 0 && count <= 65535) *picture.at(x, y) = static_cast<std::uint16_t>(count);
    }
  track.times.push_back(captured_at);
  track.depth.push_back(std::move(picture));
  return true;
}

TrackSurface surface_of(const DepthTrack& track, TimePoint epoch,
                        const TrackSurfaceConfig& config) {
  TrackSurface surface;
  surface.background = background_of(track, config.most_frames);
  for (std::size_t k = 1; k + 1 < track.depth.size(); ++k)
    if (seconds(track.times[k + 1] - track.times[k - 1]) <= 2 * kMostCaptureGap_s)
      add_moving(track, k, seconds(track.times[k] - epoch), surface.background, config,
                 surface.moving);
  add_resting(track, surface.background, config.resting_step_px, surface.resting);
  return surface;
}

}  // namespace mr::calib
