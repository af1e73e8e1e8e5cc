#include <algorithm>
#include <cmath>
#include <string>

#include "mr/scene/parts.h"

namespace mr::scene_file {
namespace {

using EventKind = RigEvent::Kind;

/// The keys that count for an event's kind; others are unknown keys.
void read_event_figures(MapReader& map, RigEvent& event) {
  using Kind = RigEvent::Kind;
  const Kind kind = event.kind;
  const auto is = [&](std::initializer_list<Kind> kinds) {
    return std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
  };
  if (!is({Kind::carry, Kind::push})) map.integer("frames", event.frames, RigEvent::kFrames);
  if (is({Kind::push, Kind::dropout})) map.need("sensor");
  if (is({Kind::vanish, Kind::push, Kind::dropout, Kind::exposure, Kind::hunt}))
    map.text("sensor", event.sensor);
  if (is({Kind::sit, Kind::chair, Kind::carry, Kind::vanish, Kind::screen})) {
    double place[2];
    if (map.numbers("place", RigEvent::kPlace_m, place)) event.place_m = Vec2d{place[0], place[1]};
  }
  if (kind == Kind::chair) map.number("by_m", event.by_m, RigEvent::kBy_m);
  if (kind == Kind::light) map.number("level", event.level, RigEvent::kLevel);
  if (kind == Kind::push) {
    map.number("by_mm", event.by_mm, RigEvent::kBy_mm);
    map.number("by_deg", event.by_deg, RigEvent::kBy_deg);
  }
  if (is({Kind::exposure, Kind::hunt})) map.number("stops", event.stops, RigEvent::kStops);
  if (kind == Kind::hunt) map.number("period_s", event.period_s, RigEvent::kPeriod_s);
}

std::optional<RigEvent> read_event(Report& report, const yaml::Node& node) {
  RigEvent event;
  MapReader map(report, node, "event");
  const bool has_kind =
      map.need("kind") != nullptr && map.choice<EventKind>("kind", event.kind,
                                                           {{"sit", EventKind::sit},
                                                            {"chair", EventKind::chair},
                                                            {"door", EventKind::door},
                                                            {"carry", EventKind::carry},
                                                            {"vanish", EventKind::vanish},
                                                            {"light", EventKind::light},
                                                            {"screen", EventKind::screen},
                                                            {"push", EventKind::push},
                                                            {"dropout", EventKind::dropout},
                                                            {"exposure", EventKind::exposure},
                                                            {"hunt", EventKind::hunt}});
  if (map.need("at")) map.integer("at", event.at, RigEvent::kAt);
  if (!has_kind) {  // which keys it may have follows from it
    map.accept_all();
    return std::nullopt;
  }
  event.frames = usual_frames(event.kind);
  read_event_figures(map, event);
  return event;
}

/// What event and rig must agree on.
void check_event(Report& report, int line, const RigEvent& event, const RigConfig& rig) {
  const std::string what = std::string("event ") + name_of(event.kind);
  if (event.at >= rig.frames)
    report.problem(line, what + " is at capture " + std::to_string(event.at) +
                             ", after the rig's last, " + std::to_string(rig.frames - 1));
  const std::vector<std::string> ids = rig.sensor_ids();
  if (!event.sensor.empty() && std::find(ids.begin(), ids.end(), event.sensor) == ids.end())
    report.problem(line,
                   what + " names " + in_quotes(event.sensor) + ", which is no sensor of the rig");
  if (event.place_m && (std::abs(event.place_m->x) > rig.room_m.x / 2 ||
                        std::abs(event.place_m->y) > rig.room_m.y / 2))
    report.problem(line, what + " has a place outside the rig's room");
}

void read_events(MapReader& map, RigConfig& rig) {
  constexpr std::size_t kMostEvents = 100;
  const yaml::Node* node = map.find("events");
  if (!node) return;
  if (node->kind != yaml::Node::Kind::list || node->items.size() > kMostEvents) {
    map.report.problem(
        node->line, "events must be a list of at most " + std::to_string(kMostEvents) + " events");
    return;
  }
  for (const yaml::Node& item : node->items)
    if (const auto event = read_event(map.report, item)) {
      check_event(map.report, item.line, *event, rig);
      rig.events.push_back(*event);
    }
}

void read_rig_errors(MapReader& map, RigConfig& rig) {
  map.number("depth_noise", rig.depth_noise, RigConfig::kDepthNoise);
  map.number("depth_noise_px", rig.depth_noise_px, RigConfig::kDepthNoise_px);
  map.number("color_noise", rig.color_noise, RigConfig::kColorNoise);
  map.number("exposure_drift", rig.exposure_drift, RigConfig::kExposure);
  map.number("exposure_period_s", rig.exposure_period_s, RigConfig::kExposurePeriod_s);
  map.number("calib_error_mm", rig.calib_error_mm, RigConfig::kCalibError_mm);
  map.number("calib_error_deg", rig.calib_error_deg, RigConfig::kCalibError_deg);
  map.number("exposure_spread", rig.exposure_spread, RigConfig::kExposure);
  map.number("clock_offset_ms", rig.clock_offset_ms, RigConfig::kClockOffset_ms);
}

void read_rig_sensors(MapReader& map, RigConfig& rig) {
  map.integer("sensors", rig.sensors, RigConfig::kSensors);
  map.integer("lidars", rig.lidars, RigConfig::kLidars);
  if (rig.sensors + rig.lidars == 0)
    map.report.problem(map.line("sensors"), "a rig needs at least one of sensors and lidars");
  map.integer("lidar_beams", rig.lidar_beams, RigConfig::kLidarBeams);
  map.number("lidar_noise_mm", rig.lidar_noise_mm, RigConfig::kLidarNoise_mm);
  std::pair<int, int> depth{rig.depth_width, rig.depth_height};
  map.choice<std::pair<int, int>>("depth_mode", depth,
                                  {{"nfov", {640, 576}},
                                   {"nfov_binned", {320, 288}},
                                   {"wfov_binned", {512, 512}},
                                   {"wfov", {1024, 1024}}});
  rig.depth_width = depth.first, rig.depth_height = depth.second;
  map.size("color", RigConfig::kColor, rig.color_width, rig.color_height);
  map.choice<bool>("noise", rig.noise, {{"kinect", true}, {"none", false}});
}

}  // namespace

RigConfig read_rig(Report& report, const yaml::Node& node) {
  RigConfig rig;
  MapReader map(report, node, "rig");
  bool synthetic = true;
  map.choice<bool>("type", synthetic, {{"synthetic", true}});
  using Kind = RigConfig::Kind;
  map.choice<Kind>("kind", rig.kind,
                   {{"room", Kind::room},
                    {"conference", Kind::conference},
                    {"office", Kind::office},
                    {"corridor", Kind::corridor},
                    {"hallway", Kind::hallway}});
  rig.room_m = usual_room_m(rig.kind);
  double seed = rig.seed;
  if (map.number("seed", seed, {0, 4294967295.0}) && seed != std::floor(seed))
    report.problem(map.line("seed"), "seed must be a whole number");
  rig.seed = static_cast<std::uint32_t>(seed);
  double room[3];
  if (map.numbers("room", RigConfig::kRoom_m, room)) rig.room_m = {room[0], room[1], room[2]};
  map.integer("people", rig.people, RigConfig::kPeople);
  read_rig_sensors(map, rig);
  map.number("detail", rig.detail, RigConfig::kDetail);
  map.integer("frames", rig.frames, RigConfig::kFrames);
  map.flag("loop", rig.loop);
  read_rig_errors(map, rig);
  read_events(map, rig);
  return rig;
}

}  // namespace mr::scene_file
