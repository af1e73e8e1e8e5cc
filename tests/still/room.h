#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "mr/still/background.h"

namespace mr::test {

/// A simulated depth camera in front of a wall and boxes.
struct Room {
  static constexpr int kWidth = 160, kHeight = 120;
  struct Box {
    Rect at;
    float depth_m = 1;
  };

  float wall_m = 3;
  std::vector<Box> boxes{};
  double noise = 1;     ///< as a multiple of the stated precision
  Rect too_far{};       ///< pixels where the wall cannot be measured
  double far_rate = 0;  ///< share of readings there that succeed nevertheless
  Precision precision{};
  std::mt19937 random{1};

  static Camera camera() {
    Camera c;
    c.width = kWidth, c.height = kHeight;
    c.fx = c.fy = 126, c.cx = kWidth / 2.0, c.cy = kHeight / 2.0;
    return c;
  }
  static still::Background background(double after_s = 5) {
    return {camera(), {}, {.precision = {}, .fps = 30, .after_s = after_s, .chunk_m = 1.28}};
  }

  ImageDepth truth() const {
    ImageDepth out(kWidth, kHeight, wall_m);
    for (const Box& box : boxes)
      for (int y = std::max(box.at.y, 0); y < std::min(box.at.y + box.at.height, kHeight); ++y)
        for (int x = std::max(box.at.x, 0); x < std::min(box.at.x + box.at.width, kWidth); ++x)
          *out.at(x, y) = std::min(*out.at(x, y), box.depth_m);
    return out;
  }
  /// One capture, in whole millimetres.
  ImageDepth capture() {
    ImageDepth out = truth();
    std::normal_distribution<double> normal;
    for (float& z : out.data)
      z = static_cast<float>(
          std::round((z + noise * precision.sigma_m(z) * normal(random)) * 1000) / 1000);
    std::bernoulli_distribution is_measured(far_rate);
    const ImageDepth exact = truth();
    for (int y = too_far.y; y < too_far.y + too_far.height; ++y)
      for (int x = too_far.x; x < too_far.x + too_far.width; ++x)
        if (*exact.at(x, y) == wall_m && !is_measured(random)) *out.at(x, y) = 0;
    return out;
  }
};

inline double share(const ImageMask& mask, const Rect& r) {
  double sum = 0;
  for (int y = r.y; y < r.y + r.height; ++y)
    for (int x = r.x; x < r.x + r.width; ++x) sum += *mask.at(x, y) != 0;
  return sum / (double(r.width) * r.height);
}
inline constexpr Rect kAll{0, 0, Room::kWidth, Room::kHeight};

/// The share of a rectangle whose still depth is within `within_m` of `depth_m`.
inline double share_at(const ImageDepth& still, const Rect& r, float depth_m,
                       float within_m = 0.02f) {
  double sum = 0;
  for (int y = r.y; y < r.y + r.height; ++y)
    for (int x = r.x; x < r.x + r.width; ++x)
      sum += std::abs(*still.at(x, y) - depth_m) <= within_m;
  return sum / (double(r.width) * r.height);
}

}  // namespace mr::test
