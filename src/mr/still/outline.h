#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"
#include "mr/still/plate_difference.h"

namespace mr::still {

/// What moves, with the outline that the colour picture shows.
struct Outline {
  /// [H, W] the moving depth, with what colour adds to it: the pixels up to the outline, hair, and
  /// thin things.
  ImageDepth depth;
  /// 0: the colour picture shows the room there, beside what moves. Of the colour picture, a pixel
  /// for AlphaPlane::kStep_px squared.
  ImageMask alpha;
};

/// Finds the outlines of what moves, where a sensor's colour picture differs from its clean plate
/// (PlateDifference). Depth ends earlier: it has fewer pixels, cleaning takes mixed ones, and hair
/// reflects little. For undistorted pinhole cameras that stand still. Colour is compared only near
/// what moves. Deterministic.
class OutlineFinder {
 public:
  OutlineFinder(const Camera& depth_camera, const Camera& color_camera, const Pose& T_color_depth);

  /// One capture. The depth pictures have the depth camera's size, `color` and `plate` the colour
  /// camera's.
  struct Input {
    const ImageDepth& measured;
    const ImageDepth& cleaned;  ///< of what moves; 0 elsewhere
    const ImageMask& moving;    ///< before cleaning
    /// The part of it that is known not to be the room: it alone has outlines. The rest is kept.
    const ImageMask& foreign;
    PlateDifference::Input colors;
  };
  Outline find(const Input& in);

 private:
  /// What depth says of a plane's pixel. `kept`: it may be the room; `edge`: the border of what
  /// moves, which colour may move.
  enum class Depth : std::uint8_t { none, still, kept, edge, moving };
  struct DepthPlane {
    Image<Depth, 1> what;
    ImageDepth nearest;  ///< m; infinite: nothing
  };

  /// A depth pixel that is next to be decided on, or was.
  struct Grown {
    int x, y;
    float depth;  ///< m, of its neighbours
    int reach;    ///< steps since what was measured
    int beside;   ///< how many of its neighbours have a depth
  };

  /// A point in the colour picture; in front of the camera if z > 0.
  struct InColor {
    float u, v, z;
  };

  InColor in_color(int x, int y, float depth) const;
  PlateColor color_at(PlateDifference& colors, int x, int y, float depth) const;
  static bool is_free(const Input& in, int x, int y, float depth);
  static std::vector<Grown> neighbours(const Input& in, const ImageDepth& depth,
                                       const std::vector<Grown>& of);
  std::vector<Grown> grow(const Input& in, PlateDifference& colors, ImageDepth& depth) const;
  static void smooth(const std::vector<Grown>& grown, ImageDepth& depth);
  void turn_away(const std::vector<Grown>& grown, ImageDepth& depth) const;
  template <typename F>
  void each_plane_pixel(int x, int y, float depth, float side_px, const F& f) const;
  static Depth kind_of(const Input& in, int x, int y);
  void draw_moving(const Input& in, const ImageDepth& depth, DepthPlane& plane) const;
  void draw_room(const Input& in, const ImageDepth& depth, const ImageMask& near,
                 DepthPlane& plane) const;
  static ImageMask near_blocks(const DepthPlane& plane);
  ImageMask decide(PlateDifference& colors, const DepthPlane& plane, const ImageMask& near) const;

  Camera depth_camera_, color_camera_;
  Vec3f translation_;                 ///< of T_color_depth
  Vec3f ray_, ray_right_, ray_down_;  ///< in the colour camera's frame, per m of depth and pixel
  int width_, height_;                ///< of the plane
  ImageMask was_different_;           ///< where compared last; empty: nowhere yet
};

}  // namespace mr::still
