#include "mr/synth/furniture.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mr/synth/interiors.h"

namespace mr::synth {

Pose standing(Vec3d place, double yaw_degrees) {
  const double a = yaw_degrees * std::numbers::pi / 180;
  const double c = std::cos(a), s = std::sin(a);
  return {{{c, -s, 0, s, c, 0, 0, 0, 1}}, place};
}

Pose at_wall(const RigConfig& rig, int wall, double right_m) {
  const double w = rig.room_m.x / 2, d = rig.room_m.y / 2;
  const Vec3d feet[] = {{0, d, 0}, {w, 0, 0}, {0, -d, 0}, {-w, 0, 0}};
  const Pose T = standing(feet[wall], -90.0 * wall);
  return {T.rotation, T * Vec3d{right_m, 0, 0}};
}

double furniture_scale(const RigConfig& rig) {
  const double s = std::min({rig.room_m.x / 6.0, rig.room_m.y / 5.0, rig.room_m.z / 2.6});
  return std::clamp(s, 0.4, 1.0);
}

void furnish(Builder& b, const RigConfig& rig, std::vector<Light>& lights) {
  using Kind = RigConfig::Kind;
  switch (rig.kind) {
    case Kind::room:
      return living_room(b, rig, lights);
    case Kind::conference:
      return conference_room(b, rig, lights);
    case Kind::office:
      return office(b, rig, lights);
    case Kind::corridor:
      return corridor(b, rig, lights);
    case Kind::hallway:
      return hallway(b, rig, lights);
  }
}

}  // namespace mr::synth
