#pragma once

#include <functional>
#include <span>
#include <vector>

#include "mr/core/vec.h"
#include "mr/synth/room.h"

namespace mr::synth {

using MaterialId = std::uint16_t;

/// Adds textured surfaces to a room. Objects are described in a frame of their own (metres, z up)
/// that place() puts into the room. Neighbouring flat faces meet in the same vertices, so no ray
/// slips between them.
class Builder {
 public:
  explicit Builder(Room& room) : room_(room) {}

  MaterialId add(Material material);
  /// A copy of a material that knows the size of the surface which it fills.
  MaterialId sized(MaterialId material, double width_m, double height_m);

  /// Where the objects that follow stand; their lengths are multiplied by `scale`.
  void place(const Pose& T_room_object, double scale = 1);

  /// A flat rectangle, seen from the side where `up` is left of `right` (right x up points to the
  /// viewer). `right` and `up` carry its size.
  void panel(Vec3d corner, Vec3d right, Vec3d up, MaterialId material);

  /// Six faces outwards. Boxes and what is turned fill blocks of the room.
  void box(Vec3d low, Vec3d high, MaterialId sides, MaterialId top);
  void box(Vec3d low, Vec3d high, MaterialId material) { box(low, high, material, material); }

  /// A curved sheet: `shape` maps [0, 1]² to the object's frame, first argument to the right.
  /// `size_m`: width and height for the texture.
  void sheet(int columns, int rows, Vec2d size_m, MaterialId material,
             const std::function<Vec3d(double, double)>& shape);

  /// A surface of revolution: turns a profile of (radius, height), from bottom to top, about the z
  /// axis through `foot`.
  void lathe(Vec3d foot, std::span<const Vec2d> profile, int sides, MaterialId material);
  void sphere(Vec3d center, double radius, MaterialId material);

  /// Records a block as occupied, so that people and cameras avoid it.
  void fill(Vec3d low, Vec3d high);

  /// [V] where to sample the light that falls on a vertex, and in which direction; world frame.
  const std::vector<Vec3f>& light_places() const { return light_places_; }
  const std::vector<Vec3f>& normals() const { return normals_; }

 private:
  Vec3d to_world(Vec3d p_object) const;

  Room& room_;
  Pose T_world_object_, T_room_object_;
  double scale_ = 1;
  std::uint32_t surfaces_ = 0;
  std::vector<Vec3f> light_places_, normals_;
};

}  // namespace mr::synth
