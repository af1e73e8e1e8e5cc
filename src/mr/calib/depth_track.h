#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/frame.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"

namespace mr::calib {

using ImageCounts = Image<std::uint16_t, 1>;

/// Depth pictures of one sensor that stands still, over some seconds, kept small: every `step_px`th
/// pixel, in counts of kCount_m.
struct DepthTrack {
  static constexpr double kCount_m = 0.0002;  ///< the largest depth is 13.1 m
  static constexpr int kMostPixels = 100'000;

  Camera camera;       ///< of the kept pixels; a pinhole without distortion
  Pose T_world_depth;  ///< as stated
  Precision precision;
  int step_px = 1;
  std::vector<TimePoint> times;    ///< ascending
  std::vector<ImageCounts> depth;  ///< as many; 0: nothing measured, or too far

  /// Bytes of the pictures.
  std::size_t bytes() const;
};

/// An empty track. The camera must be a pinhole without distortion.
DepthTrack make_depth_track(const Camera& camera, const Pose& T_world_depth,
                            const Precision& precision);

/// Adds a picture of the camera that the track was made for. False: it is not later than the last
/// one and was left out.
bool append(DepthTrack& track, TimePoint captured_at, const ImageDepth& depth);

/// A point of the surface that a sensor sees, with how fast the surface moves there; world frame.
struct MovingPoint {
  double time_s = 0;  ///< as stated, since `epoch`
  Vec3d position, normal;
  double speed_m_s = 0;  ///< along the normal
};

/// What a track shows without what moves, and points on both.
struct TrackSurface {
  ImageDepth background;             ///< [H*W] metres, 0: unknown
  std::vector<MovingPoint> moving;   ///< on what stands before the background, by time
  std::vector<MovingPoint> resting;  ///< on the background; time and speed are 0
};

struct TrackSurfaceConfig {
  int most_frames = 31;        ///< of which the background is the median, evenly spread
  double least_step_m = 0.05;  ///< in front of the background, plus four times the noise
  int most_moving = 600;       ///< points of one picture
  int resting_step_px = 6;
};

/// Points lie where the surface is smooth and seen from less than 70 degrees, and does not jump
/// between the pictures before and after.
TrackSurface surface_of(const DepthTrack& track, TimePoint epoch,
                        const TrackSurfaceConfig& config = {});

/// Bilinear depth of a picture at a pixel, in metres; none beside jumps of over `most_step_m`,
/// holes and the picture's border.
template <typename Picture>
std::optional<double> smooth_depth(const Picture& picture, double count_m, Vec2d pixel,
                                   double most_step_m) {
  if (!(pixel.x >= 0 && pixel.y >= 0 && pixel.x < picture.width - 1 &&
        pixel.y < picture.height - 1))
    return std::nullopt;
  const int x = static_cast<int>(pixel.x), y = static_cast<int>(pixel.y);
  const auto *top = picture.at(x, y), *bottom = picture.at(x, y + 1);
  const auto [low, high] = std::minmax({top[0], top[1], bottom[0], bottom[1]});
  if (!(low > 0) || (high - low) * count_m > most_step_m) return std::nullopt;
  const double fx = pixel.x - x, fy = pixel.y - y;
  return count_m * ((top[0] * (1 - fx) + top[1] * fx) * (1 - fy) +
                    (bottom[0] * (1 - fx) + bottom[1] * fx) * fy);
}

}  // namespace mr::calib
