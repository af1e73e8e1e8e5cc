#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mr/atlas/color_gain.h"
#include "mr/core/camera.h"
#include "mr/core/pose.h"

/// What the views' pictures show of points on a surface: the input of gain compensation.
namespace mr::atlas {

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
  /// Mean linear light around a pixel; nothing near the tile's border or where a channel may be
  /// clipped.
  std::optional<Vec3f> light(Vec2d pixel) const;

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
  std::size_t view = 0;  ///< index of the view
  float facing = 0;      ///< PicturedView::facing()
  float level = 0;       ///< darkest channel, approximately sRGB, 0..1
  Vec3d log_light;       ///< logarithm of linear red, green and blue
};

/// [sample] the observations in views where the sample is not occluded, not seen at a grazing
/// angle, and not clipped. Parallel.
std::vector<std::vector<Observation>> observe(std::span<const Sample> samples, const Mesh& mesh,
                                              std::span<const View> views,
                                              const Pictures& pictures);

}  // namespace mr::atlas
