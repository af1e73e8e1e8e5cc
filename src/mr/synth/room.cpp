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

Room make_room(const RigConfig& rig) {
  Room room;
  room.detail = rig.detail;
  room.T_world_room = room_pose();
  Builder builder(room);
  std::vector<Light> lights;
  build_shell(builder, rig, lights);
  furnish(builder, rig, lights);
  const Mesh* const meshes[] = {&room.mesh};
  room.rays = std::make_shared<const kit::RayScene>(meshes);
  bake_light(room, builder.light_places(), builder.normals(), lights);
  return room;
}

}  // namespace mr::synth
