#include "mr/synth/light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "mr/core/parallel.h"
#include "mr/kit/raycast.h"

namespace mr::synth {
namespace {

constexpr int kSkyRays = 32;
constexpr float kFaint = 0.0015f;    // less light is not worth a ray
constexpr float kOpenness_m = 1.6f;  // nearer surfaces take ambient light away
constexpr Vec3f kAmbient{0.42f, 0.415f, 0.42f};

/// One point of a light, in the world.
struct Emitter {
  Vec3f place, normal, power;
  bool one_sided = false;
};

std::vector<Emitter> emitters_of(const Pose& T_world_room, std::span<const Light> lights) {
  std::vector<Emitter> out;
  for (const Light& light : lights) {
    const int n = light.kind == Light::Kind::window ? 3 : 2;
    const Vec3d normal = normalized(T_world_room.rotation * cross(light.half_right, light.half_up));
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const Vec3d p = light.center + light.half_right * ((2 * i + 1.0) / n - 1) +
                        light.half_up * ((2 * j + 1.0) / n - 1);
        out.push_back({vec_cast<float>(T_world_room * p), vec_cast<float>(normal),
                       light.power / static_cast<float>(n * n), light.kind != Light::Kind::lamp});
      }
  }
  return out;
}

/// Directions about z, denser towards it as the cosine wants, evenly spread: the same for every
/// vertex, so that light varies smoothly.
std::array<Vec3f, kSkyRays> sky_directions() {
  std::array<Vec3f, kSkyRays> out;
  for (int i = 0; i < kSkyRays; ++i) {
    const double r2 = (i + 0.5) / kSkyRays, a = i * std::numbers::pi * (3 - std::sqrt(5.0));
    out[i] = vec_cast<float>(
        Vec3d{std::sqrt(r2) * std::cos(a), std::sqrt(r2) * std::sin(a), std::sqrt(1 - r2)});
  }
  return out;
}

class IrradianceSampler {
 public:
  IrradianceSampler(const Room& room, std::vector<Emitter> emitters)
      : room_(room), emitters_(std::move(emitters)), sky_(sky_directions()) {}

  Vec3f light_at(Vec3f place, Vec3f normal) const {
    return direct(place, normal) + ambient(place, normal);
  }

 private:
  bool shines(const kit::RayHit& hit) const {
    return room_.materials[room_.material[hit.triangle]].emission > 0;
  }

  Vec3f direct(Vec3f place, Vec3f normal) const {
    Vec3f sum;
    for (const Emitter& e : emitters_) {
      const Vec3f way = e.place - place;
      const float d2 = std::max(dot(way, way), 0.02f), d = std::sqrt(d2);
      const float cosine = dot(normal, way) / d;
      const float facing = e.one_sided ? -dot(e.normal, way) / d : 1.0f;
      if (cosine <= 0 || facing <= 0) continue;
      const Vec3f gain = e.power * (cosine * facing / d2);
      if (std::max({gain.x, gain.y, gain.z}) < kFaint) continue;
      const auto hit = room_.rays->first_hit(place, way, 0, 0.98f);
      if (hit && !shines(*hit)) continue;
      sum += gain;
    }
    return sum;
  }

  Vec3f ambient(Vec3f place, Vec3f normal) const {
    const Vec3f helper = std::abs(normal.z) < 0.8f ? Vec3f{0, 0, 1} : Vec3f{1, 0, 0};
    const Vec3f x = normalized(cross(helper, normal)), y = cross(normal, x);
    Vec3f sum;
    for (const Vec3f s : sky_) {
      const auto hit =
          room_.rays->first_hit(place, x * s.x + y * s.y + normal * s.z, 0, kOpenness_m);
      if (!hit || shines(*hit)) {
        sum += Vec3f{1, 1, 1};
        continue;
      }
      const float open = std::sqrt(hit->distance / kOpenness_m);
      const Vec3f bounced = room_.albedo[hit->triangle] * 0.55f + Vec3f{0.08f, 0.08f, 0.08f};
      sum += bounced * (1 - open) + Vec3f{open, open, open};
    }
    sum = sum / static_cast<float>(kSkyRays);
    return {sum.x * kAmbient.x, sum.y * kAmbient.y, sum.z * kAmbient.z};
  }

  const Room& room_;
  std::vector<Emitter> emitters_;
  std::array<Vec3f, kSkyRays> sky_;
};

}  // namespace

void bake_light(Room& room, std::span<const Vec3f> places, std::span<const Vec3f> normals,
                std::span<const Light> lights) {
  const IrradianceSampler sampler(room, emitters_of(room.T_world_room, lights));
  room.light.resize(places.size());
  parallel_for(places.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      room.light[i] = sampler.light_at(places[i], normals[i]);
  });
}

void bake_probes(Room& room, Vec3d room_m, std::span<const Light> lights) {
  constexpr double kApart_m = 0.5;
  LightProbes& probes = room.probes;
  const auto count = [](double length) {
    return std::max(2, static_cast<int>(std::ceil(length / kApart_m)) + 1);
  };
  probes.count = {count(room_m.x), count(room_m.y), count(room_m.z)};
  // The outermost ones hang a little off the walls.
  constexpr double kInset_m = 0.05;
  probes.low = {-room_m.x / 2 + kInset_m, -room_m.y / 2 + kInset_m, kInset_m};
  const Vec3d size = room_m - Vec3d{1, 1, 1} * (2 * kInset_m);
  probes.step = {size.x / (probes.count.x - 1), size.y / (probes.count.y - 1),
                 size.z / (probes.count.z - 1)};
  probes.light.resize(static_cast<std::size_t>(probes.count.x) * probes.count.y * probes.count.z);
  const IrradianceSampler sampler(room, emitters_of(room.T_world_room, lights));
  parallel_for(probes.light.size(), 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto n = static_cast<int>(i);
      const Vec3d at{1.0 * (n % probes.count.x), 1.0 * (n / probes.count.x % probes.count.y),
                     1.0 * (n / (probes.count.x * probes.count.y))};
      const Vec3d p =
          probes.low + Vec3d{at.x * probes.step.x, at.y * probes.step.y, at.z * probes.step.z};
      for (int face = 0; face < 6; ++face) {
        Vec3d normal;
        normal[face / 2] = face % 2 == 0 ? 1 : -1;
        probes.light[i][face] =
            sampler.light_at(vec_cast<float>(room.T_world_room * p),
                             vec_cast<float>(room.T_world_room.rotation * normal));
      }
    }
  });
}

Vec3f probed_light(const Room& room, Vec3f p_world, Vec3f normal_world) {
  const LightProbes& probes = room.probes;
  const Mat3 R_room_world = transposed(room.T_world_room.rotation);
  const Vec3d p = R_room_world * (vec_cast<double>(p_world) - room.T_world_room.translation);
  const Vec3f normal = vec_cast<float>(R_room_world * vec_cast<double>(normal_world));
  int cell[3];
  float part[3];
  for (int axis = 0; axis < 3; ++axis) {
    const double at = std::clamp((p[axis] - probes.low[axis]) / probes.step[axis], 0.0,
                                 probes.count[axis] - 1.001);
    cell[axis] = static_cast<int>(at);
    part[axis] = static_cast<float>(at - cell[axis]);
  }
  Vec3f sum;
  for (int corner = 0; corner < 8; ++corner) {
    std::size_t index = 0;
    float weight = 1;
    for (int axis = 2; axis >= 0; --axis) {
      const int far = corner >> axis & 1;
      weight *= far != 0 ? part[axis] : 1 - part[axis];
      index = index * static_cast<std::size_t>(probes.count[axis]) +
              static_cast<std::size_t>(cell[axis] + far);
    }
    const std::array<Vec3f, 6>& light = probes.light[index];
    for (int axis = 0; axis < 3; ++axis)
      sum += light[2 * axis + (normal[axis] < 0 ? 1 : 0)] * (weight * normal[axis] * normal[axis]);
  }
  return sum;
}

}  // namespace mr::synth
