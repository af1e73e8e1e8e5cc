#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/eval/draw_scene.h"
#include "mr/eval/ssim.h"

namespace mr::eval {

/// Mean, 5th percentile and minimum of a score over viewpoints and moments.
struct ScoreStatistics {
  double mean = 0, p5 = 0, min = 0;
};

/// Multi-View SSIM of one stream.
struct MultiViewScore {
  ScoreStatistics masked, full;
  std::optional<ScoreStatistics> seen;  ///< only pixels whose surface some sensor has seen
  double psnr_db = 0;                   ///< mean over viewpoints and moments
  std::vector<double> masked_views;     ///< [views] mean over the moments
};

/// The metric of the evaluation: SSIM (Wang et al. 2004) of rendered pictures against those of a
/// reference, from many viewpoints at several moments. What SSIM needs of the reference is computed
/// once. compare() is thread-safe after the last add().
class MultiViewSsim {
 public:
  /// Adds reference pictures, [moments][views]. Called several times for a stream that sends only
  /// some captures and shows each for a while: with the references 0, 1, … captures later, over
  /// which compare() averages. `seen`: masks [moments][views] of the pixels for ssim_seen; empty:
  /// unknown.
  Status add(const std::vector<std::vector<RenderedView>>& reference,
             const std::vector<std::vector<ImageMask>>& seen = {});

  /// Compares one picture. Masked scores use the pixels that the reference or the picture covers.
  /// invalid: it differs from the reference in size.
  Result<PictureScore> compare(std::size_t moment, std::size_t view, const ImageLuma& luma,
                               const ImageMask& covered) const;

  /// Replaces the pixels for ssim_seen of one picture, at all ages. Of the picture's size.
  void set_seen(std::size_t moment, std::size_t view, const ImageMask& seen);
  /// Whether scores have ssim_seen.
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

/// The mean over viewpoints, then over moments. `scores`: [moments][views], not empty. `with_seen`:
/// the scores have ssim_seen.
MultiViewScore summarize(const std::vector<std::vector<PictureScore>>& scores,
                         bool with_seen = false);

}  // namespace mr::eval
