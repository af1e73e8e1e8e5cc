#pragma once

#include <optional>
#include <utility>

#include "mr/atlas/color_field.h"
#include "mr/atlas/view_observations.h"
#include "mr/core/view.h"

namespace mr::atlas {

/// What a view shows at a point of the surface. Read-only; any thread.
class ColorSampler {
 public:
  virtual ~ColorSampler() = default;
  /// The colour of a surface point in a view's picture after colour correction, sRGB 0..255;
  /// nothing: the view has no picture there. Occlusion is not looked at.
  virtual std::optional<Vec3f> at(const View& view, Vec3f p_world) const = 0;
};

/// The pictures of views, corrected.
class PictureSampler final : public ColorSampler {
 public:
  PictureSampler() = default;
  PictureSampler(Pictures pictures, ColorCorrections corrections)
      : pictures_(std::move(pictures)), corrections_(std::move(corrections)) {}
  std::optional<Vec3f> at(const View& view, Vec3f p_world) const override;

 private:
  Pictures pictures_;
  ColorCorrections corrections_;
};

}  // namespace mr::atlas
