#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"
#include "mr/core/view.h"

/// What the views' pictures show of points on a surface: the input of ColorBalance.
namespace mr::atlas {

/// Pictures by stream, as DecodedScene has them.
using Pictures = std::map<StreamId, std::shared_ptr<const ImageRgb>>;
/// The tiles of a view's camera picture that may be used; all if a view has no mask.
using ValidTiles = std::map<ViewId, TileMask>;

/// A view with its picture. Refers to both.
class PicturedView {
 public:
  /// Nothing when the picture is missing or does not hold the view.
  static std::optional<PicturedView> find(const View& view, const Pictures& pictures);

  /// Cosine between a surface's unit normal and the direction to the camera.
  float facing(Vec3f p_world, Vec3f normal) const;
  /// The pixel of the stream's picture that shows a point; nothing outside the tile.
  std::optional<Vec2d> pixel(Vec3f p_world) const;
  /// The picture's colour, bilinearly interpolated.
  std::array<std::uint8_t, 3> color(Vec2d pixel) const;
  /// The range of values within two pixels, of the channel that varies most.
  int contrast(Vec2d pixel) const;
  /// The linear light around a pixel.
  struct Light {
    Vec3f mean;
    float contrast = 0;  ///< standard deviation of green over its mean
    float slope = 0;     ///< the same per pixel of the camera's picture, as if light were a ramp
  };
  /// Nothing near the tile's border or where a channel may be clipped.
  std::optional<Light> light(Vec2d pixel) const;
  /// Where in the camera's picture a pixel of the stream's picture lies, both coordinates 0..1.
  Vec2f place(Vec2d pixel) const;

 private:
  PicturedView(const View& view, const ImageRgb& picture)
      : view_(&view),
        camera_(view.camera()),
        T_camera_world_(view.T_world_camera.inverse()),
        picture_(&picture) {}

  const View* view_;
  Camera camera_;
  Pose T_camera_world_;
  const ImageRgb* picture_;
};

/// A point of the surface.
struct Sample {
  Vec3f p_world, normal;
};

/// `count` points, spread evenly by area: a low-discrepancy sequence (R2), the same for the same
/// mesh.
std::vector<Sample> spread_samples(const Mesh& mesh, std::size_t count);

/// The light of a sample in one view.
struct Observation {
  std::size_t view = 0;           ///< index of the view
  float facing = 0;               ///< PicturedView::facing()
  float level = 0;                ///< darkest channel, approximately sRGB, 0..1
  float contrast = 0, slope = 0;  ///< PicturedView::Light
  Vec2f place;                    ///< PicturedView::place()
  Vec3f log_light;                ///< logarithm of linear red, green and blue
};

/// [sample] the observations in views where the sample is not occluded, not seen at a grazing
/// angle, not clipped, and in a valid tile. Parallel.
std::vector<std::vector<Observation>> observe(std::span<const Sample> samples, const Mesh& mesh,
                                              std::span<const View> views, const Pictures& pictures,
                                              const ValidTiles& valid);

}  // namespace mr::atlas
