#pragma once

#include <optional>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"
#include "mr/core/vec.h"
#include "mr/sensor/floor.h"

namespace mr::sensor {

/// Whether a place must lie in a picture at near and at far depths, or at one of them.
enum class NearAndFar { either, both };
/// The tiles of a colour picture whose middles project into a depth picture, 1, 2 and 8 m away.
TileMask tiles_in_depth(const Camera& depth, const Camera& color, const Pose& T_depth_color,
                        int tile_px, NearAndFar wanted);

/// Where surfaces are reconstructed.
struct ReconstructedSpace {
  std::optional<Box3d> volume{};       ///< none: everywhere
  std::optional<FloorConfig> floor{};  ///< that is removed (remove_floor)
  Vec3d up{0, 0, 1};                   ///< the world's, unit length
};

/// Tells where a sensor's colour picture shows what its depth picture does not account for, so that
/// no surface takes its colour there: an occluder that is in no mesh hides nothing, though the
/// sensor measured it, and beyond the depth picture nobody knows what hides what. Pixels without
/// depth inside the depth picture do count as seen: most are dark or shiny surface.
class BlindTiles {
 public:
  static constexpr int kTile_px = 16;

  /// Undistorted cameras.
  BlindTiles(const Camera& depth_camera, const Camera& color_camera, const Pose& T_color_depth,
             const ReconstructedSpace& space);

  /// The blind tiles of the colour picture:
  ///  - those beyond the depth picture, by more than a tile, 1 to 8 m away, unless `measured` has
  ///    surface in them that is nearer than that;
  ///  - of pinhole cameras, those that are hidden: most depth is of something that is not
  ///    reconstructed (in front of the volume, or removed by cleaning) and over 5 cm and 2 % nearer
  ///    than the nearest that is reconstructed in the tile; where nothing is, all of it hides. A
  ///    removed floor counts as reconstructed: nothing lies below it. Not where depth is so coarse
  ///    that not every tile has a pixel.
  /// `measured`: the depth picture [m]; `cleaned`: what is reconstructed of the pixels `of` (null:
  /// of all). The others count as reconstructed: with layers, `of` is what moves, and a still thing
  /// that cleaning removes makes no tile blind. 1 ms for 640x576.
  TileMask blind(const ImageDepth& measured, const ImageDepth& cleaned, const ImageMask* of,
                 const Pose& T_world_depth) const;

 private:
  /// A measured depth.
  struct Sample {
    int tile;
    float z;       ///< m
    bool is_made;  ///< a surface is reconstructed of it
  };

  template <typename F>
  void each_sample(const ImageDepth& measured, const ImageDepth& cleaned, const ImageMask* of,
                   const Pose& T_world_depth, const F& f) const;

  void add_hidden(const ImageDepth& measured, const ImageDepth& cleaned, const ImageMask* of,
                  const Pose& T_world_depth, TileMask& blind) const;

  Camera depth_camera_, color_camera_;
  Pose T_color_depth_;
  ReconstructedSpace space_;
  TileMask beyond_;  ///< the depth picture
  int step_px_ = 0;  ///< between depth pixels that are looked at; 0: too coarse
};

}  // namespace mr::sensor
