#include "mr/synth/room.h"

#include <cmath>
#include <numbers>

#include "mr/kit/raycast.h"
#include "mr/synth/builder.h"
#include "mr/synth/furniture.h"
#include "mr/synth/light.h"

namespace mr::synth {
namespace {

Mat3 turn_about_x(double degrees) {
  const double a = degrees * std::numbers::pi / 180, c = std::cos(a), s = std::sin(a);
  return {{1, 0, 0, 0, c, -s, 0, s, c}};
}

}  // namespace

Pose room_pose() {
  Pose T = standing({}, 11);
  T.rotation = T.rotation * turn_about_x(3);
  return T;
}

namespace {

struct BuiltRoom {
  Room room;
  std::vector<Vec3f> light_places, normals;  // [V]
  std::vector<Light> lights;
};

BuiltRoom build(const RigConfig& rig) {
  BuiltRoom built;
  built.room.detail = rig.detail;
  built.room.T_world_room = room_pose();
  Builder builder(built.room);
  furnish(builder, rig, built.lights);
  built.light_places = builder.light_places();
  built.normals = builder.normals();
  return built;
}

}  // namespace

Room build_room(const RigConfig& rig) { return build(rig).room; }

Room make_room(const RigConfig& rig) {
  BuiltRoom built = build(rig);
  Room& room = built.room;
  const Mesh* const meshes[] = {&room.mesh};
  room.rays = std::make_shared<const kit::RayScene>(meshes);
  bake_light(room, built.light_places, built.normals, built.lights);
  if (rig.people > 0 || !rig.events.empty()) bake_probes(room, rig.room_m, built.lights);
  return std::move(built.room);
}

}  // namespace mr::synth
