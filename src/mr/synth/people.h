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

/// The time-invariant mesh data of all people and props present at a time, concatenated: walking
/// people, people of events, props of events.
struct PeopleTopology {
  std::vector<Triangle> triangles;      // [T]
  std::vector<std::uint16_t> material;  // [T]
  std::vector<std::uint32_t> surface;   // [T]
  std::vector<Vec2f> surface_m;         // [V]
  std::vector<Material> materials;
  std::vector<std::uint8_t> dark;  // [materials] swallows a depth camera's light
};

/// All people and props posed at one moment.
struct PosedPeople {
  std::shared_ptr<const PeopleTopology> topology;
  Mesh mesh;                        ///< world
  std::vector<Vec3f> light;         ///< [V]
  std::vector<Material> materials;  ///< the topology's, with films at this moment
  std::vector<Vec3d> feet;          ///< positions on the floor of contact shadows, room frame
  kit::RayScene rays;

  TexturedSurface surface(float contrast) const;
};

/// The people and props of a rig. Cameras share the posed mesh of a moment (a small cache). Not
/// thread-safe.
class People {
 public:
  /// `period_s`: the period of walking people and, if the rig loops, of everything.
  People(const RigConfig& rig, double fps, double period_s, std::shared_ptr<const Room> room);

  /// The people and props at a time, which may be negative; null if there are none.
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
