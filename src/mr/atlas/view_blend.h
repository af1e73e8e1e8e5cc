#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "mr/atlas/color_field.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"
#include "mr/core/view.h"

namespace mr::atlas {

/// How views are blended.
struct BlendConfig {
  /// Power of the resolution on the surface (pixels per m²) by which views are weighed: the higher,
  /// the more the nearest view alone counts. Over 0.
  double sharpness = 4;
  /// Only the smooth part of what the mean would change is changed, so that each picture keeps its
  /// own detail: for pictures that lie on each other. Else detail is averaged, too.
  bool keep_detail = true;

  friend bool operator==(const BlendConfig&, const BlendConfig&) = default;
};

/// Corrects the pictures of views and blends them on the surface that they show, so that borders
/// between views cannot be seen: each pixel that shows a surface becomes the mean of all views that
/// see the same point; with detail kept, in two bands as in Burt and Adelson 1983. Done in the
/// root's pictures, so neither bytes on the wire nor work at the viewer: on both sides of a border
/// between two views the pictures show the same colour. Weights: resolution on the surface (angle
/// and distance), falling to 0 within centimetres of what hides a view, of its picture's border,
/// and over a tile beside those that are not valid. Of pinhole views; others are corrected only.
/// Deterministic on any number of threads.
class ViewBlend {
 public:
  /// A view with its picture. What is referred to must outlive the blend.
  struct Source {
    const View* view = nullptr;         ///< as the child has it
    const ImageRgb* picture = nullptr;  ///< of its stream, not null
    ColorField field{};
    Vec3f log_exposure{};  ///< as in ColorCorrection
    const TileMask* valid =
        nullptr;  ///< pixels of the camera's picture that may be used; null: all
    /// Depth map of all surface (depth_camera of the view); null: it blends with no other view.
    const ImageDepth* nearest = nullptr;
  };

  ViewBlend(std::vector<Source> sources, const BlendConfig& config);
  ~ViewBlend();
  ViewBlend(ViewBlend&&) noexcept;

  /// The picture of a source, corrected, and blended where it shows `surface`. `used`: pixels of
  /// the camera's picture that are blended; null: all. `surface`: depth map of the surface that it
  /// textures (depth_camera); null: none, only corrected. With detail kept, the change goes on in
  /// used pixels beside the surface. Parallel.
  ImageRgb picture(std::size_t source, const ImageMask* used, const ImageDepth* surface) const;

 private:
  struct PreparedView;  // a source, prepared
  class Painter;        // of one picture
  std::vector<std::unique_ptr<const PreparedView>> views_;
  BlendConfig config_;
};

}  // namespace mr::atlas
