#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/eval/draw_scene.h"
#include "mr/eval/ssim.h"

namespace mr::eval {

/// Mean, 5th percentile and least of a figure over viewpoints and moments.
struct ScoreStatistics {
  double mean = 0, p5 = 0, min = 0;
};

/// Multi-View SSIM of one stream.
struct MultiViewScore {
  ScoreStatistics masked, full;
  std::optional<ScoreStatistics> seen;  ///< of the pixels that somebody could know
  double psnr_db = 0;                   ///< mean
  std::vector<double> masked_views;     ///< [views] mean over the moments
};

/// Compares pictures with those of a reference, which are prepared once. Thread-safe once made.
class MultiViewSsim {
 public:
  /// What the pictures are compared with: [moments][views]. A stream that sends some captures only
  /// shows each for a while: then the reference has several ages, and scores are their mean.
  /// `seen`: of these pixels ([moments][views]; empty: unknown) ssim_seen is made.
  Status add(const std::vector<std::vector<RenderedView>>& reference,
             const std::vector<std::vector<ImageMask>>& seen = {});

  /// Masked: pixels that the reference or the picture covers.
  Result<PictureScore> compare(std::size_t moment, std::size_t view, const ImageLuma& luma,
                               const ImageMask& covered) const;

  /// Whether scores have an ssim_seen.
  bool has_seen_masks() const { return has_seen_masks_; }

 private:
  struct ReferencePicture {
    Ssim ssim;
    ImageMask covered;
    ImageMask seen;  ///< empty: unknown
  };
  using ReferencePictures = std::vector<std::vector<ReferencePicture>>;  // [moments][views]
  std::vector<ReferencePictures> ages_;
  bool has_seen_masks_ = false;
};

/// Mean over viewpoints, then over moments. `scores`: [moments][views], not empty. `with_seen`: the
/// metric knew what was seen.
MultiViewScore summarize(const std::vector<std::vector<PictureScore>>& scores,
                         bool with_seen = false);

}  // namespace mr::eval
