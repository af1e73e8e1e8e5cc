#include "mr/atlas/color_sampler.h"

namespace mr::atlas {

std::optional<Vec3f> PictureSampler::at(const View& view, Vec3f p_world) const {
  const auto picture = PicturedView::find(view, pictures_);
  const auto pixel = picture ? picture->pixel(p_world) : std::nullopt;
  if (!pixel) return std::nullopt;
  const auto color = picture->color(*pixel);
  Vec3f out{color[0] + 0.0f, color[1] + 0.0f, color[2] + 0.0f};
  const auto found = corrections_.find(view.id);
  if (found == corrections_.end()) return out;
  const Vec3f log_gain =
      found->second.field.at(picture->place(*pixel)) + found->second.log_exposure;
  for (int c = 0; c < 3; ++c) out[c] = ToneCurves::of(log_gain[c])[color[c]];
  return out;
}

}  // namespace mr::atlas
