#include "mr/still/moving_pixels.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "mr/still/regions.h"

namespace mr::still {
namespace {

constexpr double kLeastPixels = 120;  // of a region, at 640x576
constexpr double kLeastCore = 12;     // pixels all around which is strong
constexpr int kReachWithoutDepth_px = 24;

bool is(const ImageMask& motion, int x, int y, Motion wanted) {
  return *motion.at(x, y) == static_cast<std::uint8_t>(wanted);
}

/// Whether all around a pixel is strong.
bool is_core(const ImageMask& motion, int x, int y) {
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx)
      if (motion.contains(x + dx, y + dy) && !is(motion, x + dx, y + dy, Motion::strong))
        return false;
  return true;
}

/// Adds pixels without depth that lie within reach of the mask through others of their kind.
void grow_without_depth(const ImageMask& motion, ImageMask& mask) {
  std::vector<std::pair<int, int>> front, next;
  const auto touch = [&](int x, int y) {
    if (!motion.contains(x, y) || *mask.at(x, y) || !is(motion, x, y, Motion::no_depth)) return;
    *mask.at(x, y) = 1;
    next.emplace_back(x, y);
  };
  const auto touch_around = [&](int x, int y) {
    touch(x - 1, y), touch(x + 1, y), touch(x, y - 1), touch(x, y + 1);
  };
  const ImageMask regions = mask;
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x)
      if (*regions.at(x, y)) touch_around(x, y);
  for (int step = 1; step < kReachWithoutDepth_px && !next.empty(); ++step) {
    front = std::exchange(next, {});
    for (const auto& [x, y] : front) touch_around(x, y);
  }
}

}  // namespace

ImageMask moving_regions(const ImageMask& motion, double scale) {
  ImageMask mask(motion.width, motion.height);
  for (std::size_t i = 0; i < mask.data.size(); ++i)
    mask.data[i] = motion.data[i] == 1 || motion.data[i] == 2;
  const Regions regions = connected_regions(mask);
  std::vector<std::uint32_t> core(regions.pixels.size());
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x)
      if (is(motion, x, y, Motion::strong) && is_core(motion, x, y)) ++core[*regions.label.at(x, y)];
  std::vector<std::uint8_t> keeps(regions.pixels.size());
  for (std::size_t r = 1; r < keeps.size(); ++r)
    keeps[r] = regions.pixels[r] >= std::max(8.0, kLeastPixels * scale) &&
               core[r] >= std::max(1.0, kLeastCore * scale);
  for (std::size_t i = 0; i < mask.data.size(); ++i) mask.data[i] = keeps[regions.label.data[i]];
  grow_without_depth(motion, mask);
  return mask;
}

}  // namespace mr::still
