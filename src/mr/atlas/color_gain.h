#pragma once

#include <map>
#include <memory>
#include <span>

#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/view.h"

namespace mr::atlas {

/// Factors on a view's linear red, green and blue.
using Gains = std::map<ViewId, Vec3f>;
/// Pictures by stream, as DecodedScene has them.
using Pictures = std::map<std::uint32_t, std::shared_ptr<const ImageRgb>>;

/// Gain and white balance of each view, estimated where several views see the same surface, so that
/// a seam across a plain wall does not show. The mean over all views stays as it is. Smoothed over
/// time; deterministic.
class ColorBalance {
 public:
  /// Takes a frame's evidence. `mesh`: the merged surface; `views` as the children have them, each
  /// with the stream whose picture shows it. Cheap: a few thousand samples.
  void update(const Mesh& mesh, std::span<const View> views, const Pictures& pictures);

  const Gains& gains() const { return gains_; }

 private:
  Gains gains_;
};

/// The mean step of colour across seams: over the edges of the mesh at which the view changes, the
/// mean distance (of 255, sRGB, largest channel) between what the two views show at points of the
/// edge. For measuring.
double seam_color_step(const Mesh& mesh, std::span<const View> views, const Pictures& pictures,
                       const Gains& gains);

}  // namespace mr::atlas
