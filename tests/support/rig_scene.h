#pragma once

#include <string>
#include <utility>
#include <vector>

#include "mr/scene/scene.h"

/// Small, fast scenes of the synthetic rig in which something happens.
namespace mr::test {

/// Two sensors in the default room, 160x144 depth and 160x90 colour, 10 captures a second when read
/// at that rate; without people, with exact depth. It ends after `frames`.
inline RigConfig small_rig(int frames, std::vector<RigEvent> events = {}) {
  RigConfig rig;
  rig.sensors = 2;
  rig.depth_width = 160, rig.depth_height = 144;
  rig.color_width = 160, rig.color_height = 90;
  rig.noise = false;
  rig.frames = frames;
  rig.events = std::move(events);
  return rig;
}

/// A scene of a rig: one merger takes all. Coarse, so that a capture takes little.
inline Scene rig_scene(RigConfig rig) {
  Scene scene;
  scene.id = "rig";
  scene.fps = 10;
  scene.voxel_m = 0.04;
  scene.fusion.truncation_m = 0.12;
  scene.fusion.chunk_m = 1.28;
  scene.simplify.ratio = 0.2;
  scene.mergers = {{.id = "root", .inputs = rig.sensor_ids(), .deadline_ms = 50}};
  scene.rig = std::move(rig);
  return scene;
}

// Events of each kind; captures count from 0.

inline RigEvent event(RigEvent::Kind kind, int at, int frames, std::string sensor = {}) {
  RigEvent out;
  out.kind = kind, out.at = at, out.frames = frames, out.sensor = std::move(sensor);
  return out;
}

inline RigEvent pushed_camera(int at, double by_mm = 30, double by_deg = 2,
                              std::string sensor = "cam-1") {
  RigEvent out = event(RigEvent::Kind::push, at, 1, std::move(sensor));
  out.by_mm = by_mm, out.by_deg = by_deg;
  return out;
}
inline RigEvent light_off(int at, int frames, double level = 0.2) {
  RigEvent out = event(RigEvent::Kind::light, at, frames);
  out.level = level;
  return out;
}
inline RigEvent exposure_jump(int at, int frames, double stops = 1, std::string sensor = {}) {
  RigEvent out = event(RigEvent::Kind::exposure, at, frames, std::move(sensor));
  out.stops = stops;
  return out;
}
inline RigEvent exposure_hunt(int at, int frames, double stops = 0.5, double period_s = 1,
                              std::string sensor = {}) {
  RigEvent out = event(RigEvent::Kind::hunt, at, frames, std::move(sensor));
  out.stops = stops, out.period_s = period_s;
  return out;
}
inline RigEvent depth_dropout(int at, int frames, std::string sensor = "cam-1") {
  return event(RigEvent::Kind::dropout, at, frames, std::move(sensor));
}
inline RigEvent door_opens(int at, int frames) { return event(RigEvent::Kind::door, at, frames); }
inline RigEvent chair_moved(int at, int frames = 10, double by_m = 1) {
  RigEvent out = event(RigEvent::Kind::chair, at, frames);
  out.by_m = by_m;
  return out;
}
/// A person sits still from `at` on for `frames`, then leaves.
inline RigEvent sits_still(int at, int frames) { return event(RigEvent::Kind::sit, at, frames); }
inline RigEvent box_carried_away(int at) { return event(RigEvent::Kind::carry, at, 1); }
/// A box is gone from `at` on; a person occludes its place from `sensor` for `frames`.
inline RigEvent box_gone(int at, int frames = 1, std::string sensor = {}) {
  return event(RigEvent::Kind::vanish, at, frames, std::move(sensor));
}
inline RigEvent screen_plays(int at, int frames) {
  return event(RigEvent::Kind::screen, at, frames);
}

/// The sensors' noise, `times` the stated precision, correlated over `px` pixels.
inline RigConfig noisy(RigConfig rig, double times = 1, double px = 0) {
  rig.noise = true, rig.depth_noise = times, rig.depth_noise_px = px;
  return rig;
}
/// As many people as the room has place for walk all the time, and hide and show all else.
inline RigConfig crowded(RigConfig rig, int people = 6) {
  rig.people = people;
  return rig;
}

}  // namespace mr::test
