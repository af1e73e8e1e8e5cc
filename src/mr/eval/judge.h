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
  /// What the pictures are compared with: [moments][views]. A stream that sends some captures only
  /// shows each for a while: then the reference has several ages, and scores are their mean.
  Status add(const std::vector<std::vector<Drawn>>& reference);

  /// Masked: pixels that the reference or the picture covers.
  Result<PictureScore> compare(std::size_t moment, std::size_t view, const ImageLuma& luma,
                               const ImageMask& covered) const;

 private:
  struct Face {
    Ssim ssim;
    ImageMask covered;
  };
  using Faces = std::vector<std::vector<Face>>;  // [moments][views]
  std::vector<Faces> ages_;
};

/// Mean over viewpoints, then over moments. `scores`: [moments][views], not empty.
MultiViewScore summarize(const std::vector<std::vector<PictureScore>>& scores);

}  // namespace mr::eval
