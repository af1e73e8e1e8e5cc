#include "mr/eval/multi_view_ssim.h"

#include <algorithm>

#include "mr/core/trace.h"

namespace mr::eval {
namespace {

ScoreStatistics statistics(const std::vector<double>& values) {
  ScoreStatistics out;
  for (const double v : values) out.mean += v / static_cast<double>(values.size());
  out.p5 = percentile(values, 0.05);
  out.min = *std::min_element(values.begin(), values.end());
  return out;
}

}  // namespace

Status MultiViewSsim::add(const std::vector<std::vector<RenderedView>>& reference,
                          const std::vector<std::vector<ImageMask>>& seen) {
  ReferencePictures& pictures = ages_.emplace_back();
  has_seen_masks_ = !seen.empty();
  for (std::size_t m = 0; m < reference.size(); ++m) {
    pictures.emplace_back();
    for (std::size_t v = 0; v < reference[m].size(); ++v) {
      const RenderedView& picture = reference[m][v];
      auto ssim = Ssim::prepare(luma_of(picture.color));
      if (!ssim) return ssim.error();
      pictures.back().push_back(
          {*std::move(ssim), picture.covered, has_seen_masks_ ? seen.at(m).at(v) : ImageMask{}});
    }
  }
  return {};
}

void MultiViewSsim::set_seen(std::size_t moment, std::size_t view, const ImageMask& seen) {
  for (ReferencePictures& pictures : ages_) pictures.at(moment).at(view).seen = seen;
  has_seen_masks_ = true;
}

Result<PictureScore> MultiViewSsim::compare(std::size_t moment, std::size_t view,
                                            const ImageLuma& luma, const ImageMask& covered) const {
  PictureScore sum;
  for (const ReferencePictures& pictures : ages_) {
    const ReferencePicture& reference_picture = pictures.at(moment).at(view);
    ImageMask mask = covered;
    if (mask.data.size() != reference_picture.covered.data.size())
      return Error{Error::Cause::invalid, "pictures differ in size"};
    for (std::size_t i = 0; i < mask.data.size(); ++i)
      mask.data[i] |= reference_picture.covered.data[i];
    const auto score = reference_picture.ssim.compare(luma, mask);
    if (!score) return score.error();
    const auto share = static_cast<double>(ages_.size());
    sum.ssim_full += score->ssim_full / share, sum.ssim_masked += score->ssim_masked / share;
    sum.psnr_db += score->psnr_db / share;
    if (reference_picture.seen.empty()) continue;
    const auto of_seen = reference_picture.ssim.compare(luma, reference_picture.seen);
    if (!of_seen) return of_seen.error();
    sum.ssim_seen += of_seen->ssim_masked / share;
  }
  return sum;
}

MultiViewScore summarize(const std::vector<std::vector<PictureScore>>& scores, bool with_seen) {
  std::vector<double> masked, full, seen;
  MultiViewScore out;
  out.masked_views.assign(scores.front().size(), 0);
  for (const auto& moment : scores)
    for (std::size_t v = 0; v < moment.size(); ++v) {
      masked.push_back(moment[v].ssim_masked);
      full.push_back(moment[v].ssim_full);
      seen.push_back(moment[v].ssim_seen);
      out.psnr_db += moment[v].psnr_db;
      out.masked_views[v] += moment[v].ssim_masked / static_cast<double>(scores.size());
    }
  out.psnr_db /= static_cast<double>(masked.size());
  out.masked = statistics(masked), out.full = statistics(full);
  if (with_seen) out.seen = statistics(seen);
  return out;
}

}  // namespace mr::eval
