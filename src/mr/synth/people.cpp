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

void add_body(Cast& cast, Body body) {
  const auto vertex = static_cast<std::uint32_t>(cast.surface_m.size());
  const auto material = static_cast<std::uint16_t>(cast.materials.size());
  const std::uint32_t surface =
      cast.surface.empty() ? 0 : *std::max_element(cast.surface.begin(), cast.surface.end()) + 1;
  for (const Triangle& t : body.rest.triangles)
    cast.triangles.push_back({t[0] + vertex, t[1] + vertex, t[2] + vertex});
  for (const std::uint16_t m : body.material)
    cast.material.push_back(static_cast<std::uint16_t>(material + m));
  for (const std::uint32_t s : body.surface) cast.surface.push_back(surface + s);
  cast.surface_m.insert(cast.surface_m.end(), body.surface_m.begin(), body.surface_m.end());
  for (const Material& m : body.materials) {
    cast.materials.push_back(m);
    cast.dark.push_back(is_dark(m.color));
  }
  cast.bodies.push_back(std::move(body));
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

}  // namespace

Skin PosedPeople::skin(float contrast) const {
  return {&mesh, cast->material,  cast->surface, cast->surface_m,
          light, cast->materials, contrast,      &rays};
}

People::People(const RigConfig& rig, double period_s, std::shared_ptr<const Room> room)
    : room_(std::move(room)), period_s_(period_s) {
  auto cast = std::make_shared<Cast>();
  cast->walks = plan_walks(rig, FloorPlan(rig, room_->blocks));
  for (std::size_t i = 0; i < cast->walks.size(); ++i) {
    cast->walks[i].T_world_room = room_->T_world_room;
    cast->walks[i].period_s = period_s;
    add_body(*cast, make_body(mix(rig.seed, 5000 + i)));
  }
  cast_ = std::move(cast);
}

std::shared_ptr<const PosedPeople> People::at(double time_s) {
  if (cast_->bodies.empty()) return nullptr;
  const double time = time_s - period_s_ * std::floor(time_s / period_s_);
  for (const auto& [known, people] : recent_)
    if (known == time) return people;
  recent_.emplace_front(time, pose(time));
  if (recent_.size() > kRemembered) recent_.pop_back();
  return recent_.front().second;
}

std::shared_ptr<const PosedPeople> People::pose(double time_s) const {
  Mesh mesh;
  mesh.triangles = cast_->triangles;
  mesh.positions.reserve(cast_->surface_m.size());
  std::vector<Vec3d> feet;
  std::vector<Vec3f> normals;
  const Pose T_room_world = room_->T_world_room.inverse();
  for (std::size_t i = 0; i < cast_->bodies.size(); ++i) {
    const std::vector<Vec3f> positions = pose_body(cast_->bodies[i], cast_->walks[i], time_s);
    feet.push_back(feet_of(positions, T_room_world));
    const std::vector<Vec3f> own = body_normals(cast_->bodies[i], positions);
    normals.insert(normals.end(), own.begin(), own.end());
    mesh.positions.insert(mesh.positions.end(), positions.begin(), positions.end());
  }
  std::vector<Vec3f> light(normals.size());
  parallel_for(light.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v)
      light[v] = probed_light(*room_, mesh.positions[v], normals[v]);
  });
  const Mesh* const meshes[] = {&mesh};
  kit::RayScene rays(meshes);
  return std::make_shared<const PosedPeople>(
      PosedPeople{cast_, std::move(mesh), std::move(light), std::move(feet), std::move(rays)});
}

}  // namespace mr::synth
