#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <vector>

#include "mr/kit/raycast.h"
#include "mr/synth/painter.h"
#include "mr/synth/person.h"
#include "mr/synth/room.h"

namespace mr::synth {

/// The parts of a rig's people that never change; all people's arrays one after another.
struct Cast {
  std::vector<Body> bodies;
  std::vector<Walk> walks;              // [bodies]
  std::vector<Triangle> triangles;      // [T]
  std::vector<std::uint16_t> material;  // [T]
  std::vector<std::uint32_t> surface;   // [T]
  std::vector<Vec2f> surface_m;         // [V]
  std::vector<Material> materials;
  std::vector<std::uint8_t> dark;  // [materials] swallows a depth camera's light
};

/// Everybody at one moment.
struct PosedPeople {
  std::shared_ptr<const Cast> cast;
  Mesh mesh;                 ///< world
  std::vector<Vec3f> light;  ///< [V]
  std::vector<Vec3d> feet;   ///< [people] between them, on the floor, room frame
  kit::RayScene rays;

  Skin skin(float contrast) const;
};

/// The people of a rig. Cameras that look at the same moment share one posing. One caller at a
/// time.
class People {
 public:
  /// `period_s`: after so long everything repeats.
  People(const RigConfig& rig, double period_s, std::shared_ptr<const Room> room);

  /// Everybody at a time, also before 0; nothing where the rig has no people.
  std::shared_ptr<const PosedPeople> at(double time_s);

 private:
  std::shared_ptr<const PosedPeople> pose(double time_s) const;

  const std::shared_ptr<const Room> room_;
  const double period_s_;
  std::shared_ptr<const Cast> cast_;
  std::list<std::pair<double, std::shared_ptr<const PosedPeople>>> recent_;  // newest first
};

}  // namespace mr::synth
