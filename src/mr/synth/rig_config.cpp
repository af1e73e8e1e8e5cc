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

std::vector<std::string> RigEvent::problems() const {
  const Vec2d place = place_m.value_or(Vec2d{});
  return out_of_range({{"at", at, kAt},
                       {"frames", frames, kFrames},
                       {"place", place.x, kPlace_m},
                       {"place", place.y, kPlace_m},
                       {"by_m", by_m, kBy_m},
                       {"by_mm", by_mm, kBy_mm},
                       {"by_deg", by_deg, kBy_deg},
                       {"level", level, kLevel},
                       {"stops", stops, kStops},
                       {"period_s", period_s, kPeriod_s}});
}

std::vector<std::string> RigConfig::problems() const {
  std::vector<std::string> out =
      out_of_range({{"room", room_m.x, kRoom_m},
                    {"room", room_m.y, kRoom_m},
                    {"room", room_m.z, kRoom_m},
                    {"people", people, kPeople},
                    {"sensors", sensors, kSensors},
                    {"lidars", lidars, kLidars},
                    {"lidar_beams", lidar_beams, kLidarBeams},
                    {"lidar_noise_mm", lidar_noise_mm, kLidarNoise_mm},
                    {"depth", depth_width, kDepth},
                    {"depth", depth_height, kDepth},
                    {"color", color_width, kColor},
                    {"color", color_height, kColor},
                    {"depth_noise", depth_noise, kDepthNoise},
                    {"depth_noise_px", depth_noise_px, kDepthNoise_px},
                    {"color_noise", color_noise, kColorNoise},
                    {"exposure_drift", exposure_drift, kExposure},
                    {"exposure_period_s", exposure_period_s, kExposurePeriod_s},
                    {"exposure_spread", exposure_spread, kExposure},
                    {"calib_error_mm", calib_error_mm, kCalibError_mm},
                    {"calib_error_deg", calib_error_deg, kCalibError_deg},
                    {"clock_offset_ms", clock_offset_ms, kClockOffset_ms},
                    {"detail", detail, kDetail},
                    {"frames", frames, kFrames}});
  if (sensors + lidars == 0) out.push_back("a rig needs at least one of sensors and lidars");
  for (const RigEvent& event : events)
    append(out, prefixed(std::string("event ") + name_of(event.kind) + ": ", event.problems()));
  return out;
}

}  // namespace mr::synth
