#pragma once

#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "mr/atlas/color_field.h"
#include "mr/core/image.h"
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
  struct Picture {
    std::shared_ptr<const ImageRgb> image;  ///< the whole camera picture; not null
    ColorCorrection correction{};
  };

  explicit PictureSampler(std::map<ViewId, Picture> pictures) : pictures_(std::move(pictures)) {}
  std::optional<Vec3f> at(const View& view, Vec3f p_world) const override;

 private:
  std::map<ViewId, Picture> pictures_;
};

}  // namespace mr::atlas
