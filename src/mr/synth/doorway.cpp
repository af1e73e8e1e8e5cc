#include "mr/synth/doorway.h"

#include <algorithm>

#include "mr/synth/pieces.h"
#include "mr/synth/props.h"

namespace mr::synth {
namespace {

constexpr double kVestibule_m = 2;

/// Where the rooms have their first door.
Doorway first_door(const RigConfig& rig) {
  using Kind = RigConfig::Kind;
  const double w = rig.room_m.x / 2, d = rig.room_m.y / 2;
  switch (rig.kind) {
    case Kind::room:
      return {0, w - 1.15, {}};
    case Kind::conference:
      return {3, d - 0.9, {}};
    case Kind::office:
      return {3, 0.1 * d, {}};
    case Kind::corridor: {
      const bool along_x = rig.room_m.x >= rig.room_m.y;
      const double length = std::max(rig.room_m.x, rig.room_m.y);
      const int count = std::max(1, static_cast<int>((length - 1.2) / 2.8));
      return {along_x ? 0 : 1, (0.5 / count - 0.5) * (length - 0.8), {}};
    }
    case Kind::hallway:
      break;
  }
  return {0, -0.5 - 0.2 * w, {}};
}

bool needs_door(const RigEvent& event) {
  using Kind = RigEvent::Kind;
  return event.kind == Kind::sit || event.kind == Kind::door || event.kind == Kind::carry ||
         (event.kind == Kind::vanish && !event.sensor.empty());
}

}  // namespace

Vec2d Doorway::before(double inwards_m) const {
  const Vec3d p = T_room_wall * Vec3d{x, -inwards_m, 0};
  return {p.x, p.y};
}

Pose Doorway::leaf(double open) const {
  return T_room_wall * standing({x - kDoorway_m.x / 2, 0, 0}, kDoorAngle_deg * open);
}

std::optional<Doorway> doorway_of(const RigConfig& rig) {
  if (!std::any_of(rig.events.begin(), rig.events.end(), needs_door)) return std::nullopt;
  Doorway out = first_door(rig);
  out.T_room_wall = at_wall(rig, out.wall);
  return out;
}

void vestibule(Builder& b, const Doorway& doorway) {
  const double left = doorway.x - kDoorway_m.x / 2, right = left + kDoorway_m.x;
  const Vec3d up{0, 0, kDoorway_m.y}, across{kDoorway_m.x, 0, 0}, in{0, kVestibule_m, 0};
  const MaterialId paint = b.add(plain(0xDCD6C6, 0.07f)), carpet = b.add(plain(0x6A5A4A, 0.3f));
  b.place(doorway.T_room_wall);
  b.panel({left, kVestibule_m, 0}, across, up, paint);
  b.panel({left, 0, 0}, in, up, paint);
  b.panel({right, kVestibule_m, 0}, -in, up, paint);
  b.panel({left, 0, 0}, across, in, carpet);
  b.panel({left, kVestibule_m, kDoorway_m.y}, across, -in, paint);
}

}  // namespace mr::synth
