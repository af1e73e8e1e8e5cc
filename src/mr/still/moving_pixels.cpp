#include "mr/still/moving_pixels.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "mr/still/connected_components.h"

namespace mr::still {
namespace {

constexpr double kLeastPixels = 100;  // least size of a region, at 640x576
constexpr double kLeastCore = 12;     // pixels of a region whose whole neighbourhood is strong
constexpr int kReach_px = 24;         // how far weak pixels extend a region

/// Whether all neighbours of a pixel are strong (erosion).
bool is_core(const ImageMask& strong, int x, int y) {
  for (int v = std::max(y - 1, 0); v <= std::min(y + 1, strong.height - 1); ++v)
    for (int u = std::max(x - 1, 0); u <= std::min(x + 1, strong.width - 1); ++u)
      if (!*strong.at(u, v)) return false;
  return true;
}

ImageMask large_regions(const ImageMask& strong, double scale) {
  const ConnectedComponents regions = connected_components(strong);
  std::vector<std::uint32_t> core(regions.pixels.size());
  for (const Run& s : regions.runs)
    for (int x = s.first; x < s.end; ++x) core[s.region] += is_core(strong, x, s.y);
  ImageMask out(strong.width, strong.height);
  for (const Run& s : regions.runs)
    if (regions.pixels[s.region] >= std::max(8.0, kLeastPixels * scale) &&
        core[s.region] >= std::max(1.0, kLeastCore * scale))
      std::fill(out.at(s.first, s.y), out.at(s.first, s.y) + (s.end - s.first), std::uint8_t{1});
  return out;
}

/// Region growing: adds the pixels that satisfy `joins(x, y)` and are connected to the mask by such
/// pixels within kReach_px.
template <typename Joins>
void grow(ImageMask& mask, const Joins& joins) {
  std::vector<std::pair<int, int>> front, next;
  const auto touch = [&](int x, int y) {
    if (!mask.contains(x, y) || *mask.at(x, y) || !joins(x, y)) return;
    *mask.at(x, y) = 2;
    next.emplace_back(x, y);
  };
  const auto touch_around = [&](int x, int y) {
    touch(x - 1, y), touch(x + 1, y), touch(x, y - 1), touch(x, y + 1);
  };
  for (int y = 0; y < mask.height; ++y)
    for (int x = next_set(mask.row(y), 0, mask.width); x < mask.width;
         x = next_set(mask.row(y), x + 1, mask.width))
      touch_around(x, y);
  for (int step = 1; step < kReach_px && !next.empty(); ++step) {
    front = std::exchange(next, {});
    for (const auto& [x, y] : front) touch_around(x, y);
  }
  for (std::uint8_t& m : mask.data) m = m != 0;
}

}  // namespace

ImageMask moving_regions(const ImageMask& strong, const ImageMask& no_depth,
                         const std::function<bool(int, int)>& is_weak, double scale) {
  ImageMask mask = large_regions(strong, scale);
  grow(mask, is_weak);
  grow(mask, [&](int x, int y) { return *no_depth.at(x, y) != 0; });
  return mask;
}

}  // namespace mr::still
