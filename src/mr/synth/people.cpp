#include "mr/synth/people.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/synth/floor_plan.h"
#include "mr/synth/hash.h"
#include "mr/synth/light.h"
#include "mr/synth/noise.h"

namespace mr::synth {
namespace {

constexpr std::size_t kRemembered = 4;

/// Appends a body or a prop to a topology.
template <typename Shape>
void append(PeopleTopology& topology, const Shape& shape) {
  const auto vertex = static_cast<std::uint32_t>(topology.surface_m.size());
  const auto material = static_cast<std::uint16_t>(topology.materials.size());
  const std::uint32_t surface =
      topology.surface.empty()
          ? 0
          : *std::max_element(topology.surface.begin(), topology.surface.end()) + 1;
  for (const Triangle& t : shape.rest.triangles)
    topology.triangles.push_back({t[0] + vertex, t[1] + vertex, t[2] + vertex});
  for (const std::uint16_t m : shape.material)
    topology.material.push_back(static_cast<std::uint16_t>(material + m));
  for (const std::uint32_t s : shape.surface) topology.surface.push_back(surface + s);
  topology.surface_m.insert(topology.surface_m.end(), shape.surface_m.begin(),
                            shape.surface_m.end());
  for (const Material& m : shape.materials) {
    topology.materials.push_back(m);
    topology.dark.push_back(m.emission <= 0 && is_dark(m.color));
  }
}

/// Where someone stands: the middle of what is near the floor.
Vec3d feet_of(std::span<const Vec3f> positions, const Pose& T_room_world) {
  constexpr double kAnkle_m = 0.12;
  Vec3d sum;
  int count = 0;
  for (const Vec3f p : positions) {
    const Vec3d q = T_room_world * vec_cast<double>(p);
    if (q.z > kAnkle_m) continue;
    sum += q;
    ++count;
  }
  return count > 0 ? Vec3d{sum.x / count, sum.y / count, 0} : Vec3d{1e6, 1e6, 0};
}

/// Positions and normals of a moment, world.
struct Posed {
  std::vector<Vec3f> positions, normals;

  void add(const Body& body, const std::vector<Vec3f>& of_body) {
    const std::vector<Vec3f> own = body_normals(body, of_body);
    normals.insert(normals.end(), own.begin(), own.end());
    positions.insert(positions.end(), of_body.begin(), of_body.end());
  }
  void add(const Prop& prop, const Pose& T_world_prop) {
    for (const Vec3f p : prop.rest.positions)
      positions.push_back(vec_cast<float>(T_world_prop * vec_cast<double>(p)));
    for (const Vec3f n : prop.normals)
      normals.push_back(vec_cast<float>(T_world_prop.rotation * vec_cast<double>(n)));
  }
};

double wrapped(double time_s, double period_s) {
  return time_s - period_s * std::floor(time_s / period_s);
}

}  // namespace

TexturedSurface PosedPeople::surface(float contrast) const {
  return {&mesh, topology->material, topology->surface, topology->surface_m,
          light, materials,          contrast,          &rays};
}

People::People(const RigConfig& rig, double fps, double period_s, std::shared_ptr<const Room> room)
    : room_(std::move(room)), period_s_(period_s), loops_(rig.loop) {
  walks_ = plan_walks(rig, FloorPlan(rig, room_->blocks));
  for (std::size_t i = 0; i < walks_.size(); ++i) {
    walks_[i].T_world_room = room_->T_world_room;
    walks_[i].period_s = period_s;
    bodies_.push_back(make_body(mix(rig.seed, 5000 + i)));
  }
  if (!rig.events.empty()) script_ = make_script(rig, fps, room_->blocks, walks_);
}

std::vector<bool> People::present_at(double script_s) const {
  std::vector<bool> present(bodies_.size(), true);
  for (const ScriptedPerson& who : script_.people) present.push_back(who.at(script_s).has_value());
  for (const ScriptedProp& prop : script_.props)
    present.push_back(prop.T_room_prop(script_s).has_value());
  return present;
}

std::shared_ptr<const PeopleTopology> People::topology_of(const std::vector<bool>& present) {
  std::shared_ptr<const PeopleTopology>& known = topologies_[present];
  if (known) return known;
  auto topology = std::make_shared<PeopleTopology>();
  std::size_t next = 0;
  for (const Body& body : bodies_)
    if (present[next++]) append(*topology, body);
  for (const ScriptedPerson& who : script_.people)
    if (present[next++]) append(*topology, who.body);
  for (const ScriptedProp& prop : script_.props)
    if (present[next++]) append(*topology, prop.shape);
  return known = std::move(topology);
}

std::shared_ptr<const PosedPeople> People::at(double time_s) {
  const double walk_s = wrapped(time_s, period_s_);
  const bool scripted = !script_.people.empty() || !script_.props.empty();
  if (bodies_.empty() && !scripted) return nullptr;
  const double script_s = loops_ ? walk_s : time_s, key = scripted ? script_s : walk_s;
  for (const auto& [known, people] : recent_)
    if (known == key) return people;
  recent_.emplace_front(key, pose(walk_s, script_s));
  if (recent_.size() > kRemembered) recent_.pop_back();
  return recent_.front().second;
}

std::shared_ptr<const PosedPeople> People::pose(double walk_s, double script_s) {
  const auto topology = topology_of(present_at(script_s));
  if (topology->triangles.empty()) return nullptr;
  Posed posed;
  std::vector<Vec3d> feet;
  const Pose T_room_world = room_->T_world_room.inverse();
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const std::vector<Vec3f> positions = pose_body(bodies_[i], walks_[i], walk_s);
    feet.push_back(feet_of(positions, T_room_world));
    posed.add(bodies_[i], positions);
  }
  for (const ScriptedPerson& who : script_.people)
    if (const auto stance = who.at(script_s)) {
      const std::vector<Vec3f> positions =
          pose_body(who.body, posture_of(who.body.skeleton, *stance, room_->T_world_room));
      feet.push_back(feet_of(positions, T_room_world));
      posed.add(who.body, positions);
    }
  std::vector<Material> materials = topology->materials;
  std::size_t film = materials.size();  // of the first prop's: props come last
  for (const ScriptedProp& prop : script_.props)
    if (prop.T_room_prop(script_s)) film -= prop.shape.materials.size();
  for (const ScriptedProp& prop : script_.props) {
    const auto T_room_prop = prop.T_room_prop(script_s);
    if (!T_room_prop) continue;
    posed.add(prop.shape, room_->T_world_room * *T_room_prop);
    if (prop.on_floor && T_room_prop->translation.z < 0.05)
      feet.push_back(T_room_prop->translation);
    for (std::size_t m = 0; m < prop.shape.materials.size(); ++m, ++film)
      if (prop.phase && materials[film].pattern == Pattern::film)
        materials[film].phase = prop.phase(script_s);
  }
  std::vector<Vec3f> light(posed.normals.size());
  parallel_for(light.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v)
      light[v] = probed_light(*room_, posed.positions[v], posed.normals[v]);
  });
  Mesh mesh;
  mesh.positions = std::move(posed.positions);
  mesh.triangles = topology->triangles;
  const Mesh* const meshes[] = {&mesh};
  kit::RayScene rays(meshes);
  return std::make_shared<const PosedPeople>(PosedPeople{topology, std::move(mesh),
                                                         std::move(light), std::move(materials),
                                                         std::move(feet), std::move(rays)});
}

}  // namespace mr::synth
