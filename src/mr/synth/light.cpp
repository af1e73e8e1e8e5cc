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
    const int n = light.is_window ? 3 : 2;
    const Vec3d normal = normalized(T_world_room.rotation * cross(light.half_right, light.half_up));
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const Vec3d p = light.center + light.half_right * ((2 * i + 1.0) / n - 1) +
                        light.half_up * ((2 * j + 1.0) / n - 1);
        out.push_back({vec_cast<float>(T_world_room * p), vec_cast<float>(normal),
                       light.power / static_cast<float>(n * n), light.is_window});
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

class Gatherer {
 public:
  Gatherer(const Room& room, std::vector<Emitter> emitters)
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
      const auto hit = room_.rays->first_hit(place, way, 0, 0.98f);
      if (hit && !shines(*hit)) continue;
      sum += e.power * (cosine * facing / d2);
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
  const Gatherer gatherer(room, emitters_of(room.T_world_room, lights));
  room.light.resize(places.size());
  parallel_for(places.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      room.light[i] = gatherer.light_at(places[i], normals[i]);
  });
}

}  // namespace mr::synth
