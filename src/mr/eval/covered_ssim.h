#pragma once

#include <cstdint>

#include "mr/core/image.h"
#include "mr/core/result.h"
#include "mr/eval/ssim.h"

namespace mr::eval {

/// Similarity of two pictures where a mask covers them.
struct CoveredScore {
  double ssim = 0;     ///< mean over the windows; 0 without any
  double psnr_db = 0;  ///< luma, over all covered pixels; kSamePsnr_db when they are equal
  std::uint64_t windows =
      0;  ///< that count: inside the picture, with a covered pixel in the middle
};

/// Structural similarity as Ssim computes it, by normalised convolution (Knutsson and Westin 1993):
/// means and variances of a window are those of its covered pixels, with the window's weights
/// scaled to the sum 1, so that what is not covered neither helps nor harms. Where all is covered
/// it is Ssim's `ssim_full`. Doubles; the same result on any number of threads. invalid: the
/// pictures or the mask differ in size, are smaller than a window (11x11), or hold a value that is
/// not finite.
Result<CoveredScore> covered_ssim(const ImageLuma& test, const ImageLuma& reference,
                                  const ImageMask& covered);

}  // namespace mr::eval
