#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "mr/atlas/labels.h"
#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/core/view.h"
#include "mr/kit/raster.h"

namespace mr::atlas {

/// How much of one triangle is visible in one view.
struct TriangleVisibility {
  float visible = 0;     ///< share of the triangle's pixels that are visible, outside of
                         ///< occluders' margins; 0 if the view is not usable
  float direct_px = 0;   ///< visible pixels, margins included; 0 if the view is not usable
  float facing = 0;      ///< cosine between the normal and the direction to the camera
  bool touches = false;  ///< some of it is inside the picture and visible
};

/// A pinhole depth buffer of the mesh: of a view, of a part of it, or of one of a panorama's six
/// cube faces.
class Face {
 public:
  /// Pixel counts of a triangle: all; visible outside margins; visible.
  struct Count {
    int pixels = 0, clear = 0, direct = 0;
  };

  /// `ring_px`: border pixels that serve only as neighbourhood of inner ones. `others`: depth map
  /// of another surface, of which `camera` shows the part from (x, y) on; may be null.
  Face(const Mesh& mesh, const Camera& camera, const Pose& T_world_face, int ring_px,
       const ImageDepth* others, int x, int y, const LabelConfig& config);

  /// Adds the pixels inside a triangle.
  void count(const std::array<Vec3f, 3>& corners, Count& count) const;
  /// Adds the pixel at a point, if it is inside.
  void count(Vec3f point, Count& count) const;
  /// Whether a column of the whole picture lies in this face, within one pixel.
  bool has_column(double x) const { return x >= left_ - 1 && x <= left_ + camera_.width; }

 private:
  Vec3d in_face(Vec3f p_world) const { return T_face_world_ * vec_cast<double>(p_world); }
  void add(const kit::ScreenSpan& s, Count& count) const;

  Camera camera_;
  Pose T_face_world_;
  int ring_, left_;
  float error_m_, noise_per_m2_;  ///< least distance of an occluder in front of the surface
  float pixel_;                   ///< width of a pixel at 1 m
  ImageDepth depth_;
  int margin_;
  ImageDepth around_;
};

/// The pixels of a view's picture that are valid for texture (LabelConfig::valid).
class ValidRegion {
 public:
  enum class Share { none, some, all };

  explicit ValidRegion(const TileMask* mask) : mask_(mask) {}
  bool is_whole() const { return mask_ == nullptr; }

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

  const TileMask* mask_;  ///< null: all pixels are valid
};

/// Tests which triangles of a mesh are visible in a view, by depth buffer: that of the view, or
/// those of a panorama's six cube faces.
class ViewVisibility {
 public:
  /// The view must outlive this, and so must the masks of `config.valid`.
  ViewVisibility(const Mesh& mesh, const View& view, const LabelConfig& config);

  /// `normal_world`: the smoothed surface normal at the triangle.
  TriangleVisibility of_triangle(const Mesh& mesh, std::size_t t, Vec3f normal_world) const;

 private:
  Face::Count count_pixels(const std::array<Vec3f, 3>& corners, Vec3f middle) const;
  ValidRegion::Share valid_share(const std::array<Vec3f, 3>& corners) const;
  std::vector<Vec3f> valid_samples(const std::array<Vec3f, 3>& corners) const;
  bool is_whole_turn() const;
  std::optional<Vec2d> pixel_of(Vec3f p_world) const;
  bool is_inside(const std::array<Vec3f, 3>& corners) const;
  bool inside_tile(Vec2d pixel) const;

  const View& view_;
  Camera camera_;
  Pose T_camera_world_;
  ValidRegion valid_;
  std::vector<Face> faces_;
};

}  // namespace mr::atlas
