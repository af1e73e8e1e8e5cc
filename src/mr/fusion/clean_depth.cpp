#include "mr/fusion/clean_depth.h"

#include <cmath>

#include "mr/core/assert.h"
#include "mr/fusion/fill_dropouts.h"
#include "mr/fusion/mixed_pixels.h"
#include "mr/fusion/ray_grid.h"
#include "mr/fusion/smooth_depth.h"
#include "mr/fusion/speckle.h"

namespace mr::fusion {

ImageDepth clean_depth(const ImageDepth& depth, const Camera& camera, const Precision& of_one,
                       const CleanConfig& config, int readings) {
  if (depth.empty()) return depth;
  MR_ASSERT(camera.width == depth.width && camera.height == depth.height && readings > 0);
  const double times = std::sqrt(static_cast<double>(readings));
  const Precision precision{.base_m = of_one.base_m / times, .per_m2 = of_one.per_m2 / times};
  const RaySpacing rays(camera);
  RayGrid grid = to_grid(depth, rays);
  if (config.mixed_pixels) grid = drop_mixed_pixels(grid, rays, precision);
  if (config.fill_px > 0) grid = fill_dropouts(grid, rays, precision, config.fill_px, readings > 1);
  if (config.speckle_px > 0) drop_speckle(grid, rays, precision, config.speckle_px);
  if (config.smooth_depth) grid = smooth_depth(grid, rays, precision);
  return to_depth(grid, rays, config.smooth_depth ? nullptr : &depth);
}

}  // namespace mr::fusion
