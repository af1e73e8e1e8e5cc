#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/eval/draw.h"
#include "mr/eval/ssim.h"

namespace mr::eval {

/// Mean, 5th percentile and least of a figure over viewpoints and moments.
struct Spread {
  double mean = 0, p5 = 0, min = 0;
};

/// Multi-View SSIM of one stream.
struct MultiViewScore {
  Spread masked, full;
  double psnr_db = 0;                ///< mean
  std::vector<double> masked_views;  ///< [views] mean over the moments
};

/// Compares pictures with those of a reference, which are prepared once. Thread-safe once made.
class Judge {
 public:
  /// `reference`: [moments][views], all of one size per view.
  static Result<Judge> prepare(const std::vector<std::vector<Drawn>>& reference);

  std::size_t moments() const { return faces_.size(); }
  std::size_t views() const { return faces_.empty() ? 0 : faces_.front().size(); }

  /// Masked: pixels that the reference or the picture covers.
  Result<PictureScore> compare(std::size_t moment, std::size_t view, const ImageLuma& luma,
                               const ImageMask& covered) const;

 private:
  struct Face {
    Ssim ssim;
    ImageMask covered;
  };
  std::vector<std::vector<Face>> faces_;
};

/// Mean over viewpoints, then over moments. `scores`: [moments][views], not empty.
MultiViewScore summarize(const std::vector<std::vector<PictureScore>>& scores);

}  // namespace mr::eval
