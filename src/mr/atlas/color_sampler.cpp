#include "mr/atlas/color_sampler.h"

#include "mr/core/camera.h"

namespace mr::atlas {
namespace {

/// Nothing: the point lies behind the camera.
std::optional<Vec2d> pixel_of(const View& view, Vec3f p_world) {
  const Vec3d p = view.T_world_camera.inverse() * vec_cast<double>(p_world);
  if (view.kind != View::Kind::pinhole) return project(view.camera(), p);
  if (!(p.z > 0)) return std::nullopt;
  return Vec2d{view.fx * p.x / p.z + view.cx, view.fy * p.y / p.z + view.cy};
}

}  // namespace

std::optional<Vec3f> PictureSampler::at(const View& view, Vec3f p_world) const {
  const auto found = pictures_.find(view.id);
  if (found == pictures_.end()) return std::nullopt;
  const auto& [image, correction] = found->second;
  if (image->width != view.width || image->height != view.height) return std::nullopt;
  const auto pixel = pixel_of(view, p_world);
  const double most_x = view.width - 0.5, most_y = view.height - 0.5;
  if (!pixel || !(pixel->x > -0.5 && pixel->y > -0.5 && pixel->x < most_x && pixel->y < most_y))
    return std::nullopt;
  const auto c = sample_bilinear(*image, {0, 0, view.width, view.height}, pixel->x, pixel->y);
  const Vec3f log_gain = correction.field.at({static_cast<float>((pixel->x + 0.5) / view.width),
                                              static_cast<float>((pixel->y + 0.5) / view.height)}) +
                         correction.log_exposure;
  Vec3f out;
  for (int i = 0; i < 3; ++i) out[i] = ToneCurves::of(log_gain[i])[c[i]];
  return out;
}

}  // namespace mr::atlas
