#pragma once

#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <vector>

#include "mr/kit/raycast.h"
#include "mr/synth/person.h"
#include "mr/synth/pixel_shader.h"
#include "mr/synth/room.h"
#include "mr/synth/script.h"

namespace mr::synth {

/// The parts that never change of those who are there at a time; all arrays one after another:
/// people who walk, people of events, things of events.
struct PeopleTopology {
  std::vector<Triangle> triangles;      // [T]
  std::vector<std::uint16_t> material;  // [T]
  std::vector<std::uint32_t> surface;   // [T]
  std::vector<Vec2f> surface_m;         // [V]
  std::vector<Material> materials;
  std::vector<std::uint8_t> dark;  // [materials] swallows a depth camera's light
};

/// Everybody at one moment, and the things that events move.
struct PosedPeople {
  std::shared_ptr<const PeopleTopology> topology;
  Mesh mesh;                        ///< world
  std::vector<Vec3f> light;         ///< [V]
  std::vector<Material> materials;  ///< the topology's, films at this moment
  std::vector<Vec3d> feet;          ///< what shades the floor: places on it, room frame
  kit::RayScene rays;

  TexturedSurface surface(float contrast) const;
};

/// The people of a rig and what its events move. Cameras that look at the same moment share one
/// posing. One caller at a time.
class People {
 public:
  /// `period_s`: after so long people who walk are where they were; with `loop` all is.
  People(const RigConfig& rig, double fps, double period_s, std::shared_ptr<const Room> room);

  /// Everybody at a time, also before 0; null where nobody is there and nothing may move.
  std::shared_ptr<const PosedPeople> at(double time_s);

 private:
  /// Who is there: walkers, performers, props.
  std::vector<bool> present_at(double script_s) const;
  std::shared_ptr<const PeopleTopology> topology_of(const std::vector<bool>& present);
  std::shared_ptr<const PosedPeople> pose(double walk_s, double script_s);

  const std::shared_ptr<const Room> room_;
  const double period_s_;
  const bool loops_;
  std::vector<Body> bodies_;
  std::vector<Walk> walks_;  // [bodies_]
  Script script_;
  std::map<std::vector<bool>, std::shared_ptr<const PeopleTopology>> topologies_;
  std::list<std::pair<double, std::shared_ptr<const PosedPeople>>> recent_;  // newest first
};

}  // namespace mr::synth
