#pragma once

#include "mr/core/image.h"
#include "mr/core/result.h"

namespace mr::eval {

using ImageLuma = Image<float, 1>;  ///< BT.709 luma of 8-bit pictures, 0..255

ImageLuma luma_of(const ImageRgb& picture);

/// The window and the constants of SSIM.
inline constexpr int kSsimWindow_px = 11;
inline constexpr double kSsimSigma_px = 1.5;
inline constexpr double kSsimC1 = 0.01 * 255 * (0.01 * 255), kSsimC2 = 0.03 * 255 * (0.03 * 255);

/// Similarity of two pictures. `masked`: only windows around the mask's pixels.
struct PictureScore {
  double ssim_full = 0, ssim_masked = 0;
  double ssim_seen = 0;  ///< see MultiViewSsim
  double psnr_db = 0;    ///< luma, only the mask's pixels; kSamePsnr_db when they are equal
};
inline constexpr double kSamePsnr_db = 100;

/// Structural similarity (Wang, Bovik, Sheikh and Simoncelli 2004) to one reference picture, whose
/// means and variances are computed once: 11x11 Gaussian windows of sigma 1.5, K1 0.01, K2 0.03, L
/// 255, only windows that lie inside the picture (docs/evaluation.md, Pictures). Agrees with
/// scikit-image's structural_similarity(gaussian_weights=True, sigma=1.5,
/// use_sample_covariance=False, data_range=255) to 1e-3. Parallel over rows; the same result on any
/// number of threads.
class Ssim {
 public:
  /// invalid: the picture is smaller than a window, or a value is not finite.
  static Result<Ssim> prepare(ImageLuma reference);

  /// `mask` ([H, W], 1 = of interest; empty: everywhere) is dilated by the window first; a mask
  /// that marks nothing gives ssim_masked 1. invalid: sizes differ, or a value is not finite.
  Result<PictureScore> compare(const ImageLuma& test, const ImageMask& mask = {}) const;

  const ImageLuma& reference() const { return reference_; }

 private:
  Ssim() = default;

  ImageLuma reference_;
  ImageLuma mean_, variance_;  ///< [H - 10, W - 10 rounded up to 4] of the reference's windows
};

}  // namespace mr::eval
