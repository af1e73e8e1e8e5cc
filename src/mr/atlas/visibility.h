#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mr/atlas/depth_edges.h"
#include "mr/atlas/labels.h"
#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/core/view.h"
#include "mr/kit/raster.h"

namespace mr::atlas {

/// How much of one triangle is visible in one view, and how well.
struct TriangleVisibility {
  float visible = 0;     ///< share of the triangle's pixels that are visible, outside of
                         ///< occluders' margins; 0 if the view is not usable
  float direct_px = 0;   ///< visible pixels, margins included; 0 if the view is not usable
  float near_px = 0;     ///< the same, counting pixels in which the view shows surface less than
                         ///< 5 cm in front
  float facing = 0;      ///< cosine between the normal and the direction to the camera
  float cost = 0;        ///< how badly the view shows it: see quality_cost()
  bool touches = false;  ///< some of it is inside the picture and visible
};

/// What the quality of a view at a triangle follows from.
struct ViewQuality {
  float pixels_per_m2 = 0;  ///< resolution on the surface: distance and angle in one
  float facing = 0;         ///< cosine between the normal and the direction to the camera
  float border = 0;         ///< distance from the picture's border, as a share of its width
  float depth_edge_px = 0;  ///< distance from the next depth edge, pixels of the depth map
  float cut = 0;            ///< share of the triangle where the view's alpha is 0
};
/// The cost of texturing a square metre from a view; only differences between views count. Half
/// the resolution along a line costs 0.5; in addition up to 0.5 each for a flat angle, for lying
/// within 4 % of the picture's width of its border, and for lying within 16 pixels of a depth edge,
/// where poses that are a little off show the other surface, and 4 where alpha is 0. Smooth.
float quality_cost(const ViewQuality& quality);

/// A pinhole depth buffer of the mesh: of a view, of a part of it, or of one of a panorama's six
/// cube faces.
class Face {
 public:
  /// Pixel counts of a triangle: all; visible outside margins; visible; with nothing more than 5 cm
  /// in front.
  struct Count {
    int pixels = 0, clear = 0, direct = 0, near = 0;
  };
  /// The depth map of another surface for the same camera (null: none), and where in the camera's
  /// picture the face lies; `ring_px`: border pixels that serve only as neighbourhood of inner
  /// ones.
  struct Place {
    Rect part;
    int ring_px = 0;
    const ImageDepth* others = nullptr;
    double least_margin_px = 2;  ///< around an occluder, whatever the geometry error
  };

  /// `projection`: of the mesh, by the camera; `triangles`: those that reach into the part.
  Face(const Mesh& mesh, std::span<const std::uint32_t> triangles, const Camera& camera,
       const kit::Projection& projection, const Place& place, const LabelConfig& config);

  /// Adds the pixels inside a triangle of the camera's picture; of a small one, four samples.
  void count(const kit::ScreenPolygon& triangle, Count& count) const;
  /// Adds the pixel at a point, if it is inside.
  void count(const kit::ScreenPoint& point, Count& count) const;
  /// Whether a column of the camera's picture lies in this face, within one pixel.
  bool has_column(double x) const { return x >= part_.x - 1 && x <= part_.x + part_.width; }
  /// Distance of a point of the camera's picture from the next depth edge.
  float edge_distance_px(double x, double y) const {
    return edges_.distance_px(static_cast<float>(x - part_.x), static_cast<float>(y - part_.y));
  }
  const Camera& camera() const { return camera_; }

 private:
  void add(float nearest, float around, float z, Count& count) const;
  void add(const kit::ScreenSpan& s, Count& count) const;
  void add_samples(const kit::ScreenPolygon& p, Count& count) const;

  Camera camera_;
  Rect part_;
  int ring_;
  float error_m_, noise_per_m2_;  ///< least distance of an occluder in front of the surface
  float pixel_;                   ///< width of a pixel at 1 m
  ImageDepth depth_;
  int margin_;
  ImageDepth around_;
  DepthEdges edges_;
};

/// The pixels of a view's picture that are valid for texture (LabelConfig::valid).
class ValidRegion {
 public:
  enum class Share { none, some, all };

  explicit ValidRegion(const TileMask* mask);
  bool is_whole() const { return mask_ == nullptr; }

  /// How many of the tiles under the pixels of a rectangle are valid; those beside the picture are
  /// not. At most a few look-ups (summed-area table).
  Share share_in(Vec2d least, Vec2d most) const;

  /// Counts the tiles under pixels [first, last] of a row.
  void add(int y, int first, int last, int& valid, int& invalid) const {
    for (int tile = first / mask_->tile_px; tile <= last / mask_->tile_px; ++tile)
      ++(is_valid(tile, y / mask_->tile_px) ? valid : invalid);
  }
  void add(Vec2d pixel, int& valid, int& invalid) const {
    const int x = static_cast<int>(std::lround(pixel.x)),
              y = static_cast<int>(std::lround(pixel.y));
    ++(x >= 0 && y >= 0 && is_valid(x / mask_->tile_px, y / mask_->tile_px) ? valid : invalid);
  }
  static Share share(int valid, int invalid) {
    return valid == 0 ? Share::none : invalid > 0 ? Share::some : Share::all;
  }

 private:
  bool is_valid(int column, int row) const {
    return column < mask_->columns && row < mask_->rows && mask_->at(column, row);
  }

  const TileMask* mask_;                   ///< null: all pixels are valid
  std::vector<std::uint32_t> valid_sums_;  ///< [rows + 1, columns + 1] summed-area table
};

/// Tests which triangles of a mesh are visible in a view, by depth buffer: that of the view, or
/// those of a panorama's six cube faces.
class ViewVisibility {
 public:
  /// The depth buffer shows `triangles` of the mesh. The view must outlive this, and so must the
  /// masks of `config.valid`.
  ViewVisibility(const Mesh& mesh, std::span<const std::uint32_t> triangles, const View& view,
                 const LabelConfig& config);

  /// `mesh`: that of the constructor, or one with the same first vertices. `normal_world`: the
  /// smoothed surface normal at the triangle, of any length.
  TriangleVisibility of_triangle(const Mesh& mesh, std::size_t t, Vec3f normal_world) const;

 private:
  using Corners = std::array<Vec3f, 3>;

  void add_picture(const Mesh& mesh, std::span<const std::uint32_t> triangles,
                   const LabelConfig& config);
  void add_strips(const Mesh& mesh, std::span<const std::uint32_t> triangles, Face::Place place,
                  const LabelConfig& config);
  void add_cube_faces(const Mesh& mesh, std::span<const std::uint32_t> triangles,
                      const LabelConfig& config);
  bool is_outside(const Triangle& triangle) const;
  kit::ScreenPolygon polygon(const Mesh& mesh, std::size_t t) const;
  kit::ScreenPolygon in_face(std::size_t face, const Corners& corners) const;
  Face::Count count_in_picture(const kit::ScreenPolygon& polygon, float& edge_px) const;
  Face::Count count_in_cube(const Corners& corners, float& edge_px) const;
  float cost(const kit::ScreenPolygon& polygon, Vec3f middle, ViewQuality quality) const;
  float cut_share(const Corners& corners, Vec3f middle) const;
  ValidRegion::Share valid_share(const Corners& corners) const;
  std::vector<Vec3f> valid_samples(const Corners& corners) const;
  bool is_pinhole() const { return view_.kind == View::Kind::pinhole; }
  bool is_whole_turn() const;
  std::optional<Vec2d> pixel_of(Vec3f p_world) const;
  bool is_inside(const kit::ScreenPolygon& outline) const;
  bool is_inside(const Corners& corners) const;
  bool inside_tile(Vec2d pixel) const;

  const View& view_;
  Camera camera_, depth_camera_;
  Vec3f eye_;
  Pose T_camera_world_;
  ValidRegion valid_;
  const Alpha* alpha_;              ///< null: 1 everywhere
  kit::Projection projection_;      ///< of a pinhole, by depth_camera_
  std::vector<Pose> T_face_world_;  ///< [faces] of a panorama
  std::vector<Face> faces_;
};

}  // namespace mr::atlas
