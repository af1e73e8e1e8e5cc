#include "mr/synth/rig_config.h"

namespace mr::synth {

int usual_frames(RigEvent::Kind kind) {
  using Kind = RigEvent::Kind;
  switch (kind) {
    case Kind::chair:
      return 30;
    case Kind::sit:
      return 300;
    case Kind::carry:
    case Kind::push:
      return 1;  // they do not end
    case Kind::door:
    case Kind::vanish:
    case Kind::light:
    case Kind::screen:
    case Kind::dropout:
    case Kind::exposure:
    case Kind::hunt:
      break;
  }
  return 90;
}

const char* name_of(RigEvent::Kind kind) {
  constexpr const char* kNames[] = {"sit",    "chair", "door",    "carry",    "vanish", "light",
                                    "screen", "push",  "dropout", "exposure", "hunt"};
  return kNames[static_cast<int>(kind)];
}

Vec3d usual_room_m(RigConfig::Kind kind) {
  constexpr Vec3d kSizes[] = {{6, 5, 3}, {7, 5, 2.8}, {6, 5, 2.8}, {2.2, 12, 2.6}, {6, 5, 3}};
  return kSizes[static_cast<int>(kind)];
}

std::vector<std::string> RigConfig::sensor_ids() const {
  std::vector<std::string> ids;
  for (int i = 0; i < sensors; ++i) ids.push_back("cam-" + std::to_string(i));
  for (int i = 0; i < lidars; ++i) ids.push_back("lidar-" + std::to_string(i));
  return ids;
}

}  // namespace mr::synth
