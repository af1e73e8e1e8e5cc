#include "mr/synth/pixel_shader.h"

#include <algorithm>
#include <cmath>

namespace mr::synth {
namespace {

constexpr int kToneSteps = 8192;
constexpr float kBrightest = 4;
constexpr float kExposure = 1.5f;

using ToneTable = std::array<std::uint8_t, kToneSteps>;

/// `exposed`: light times kExposure; 0..255.
double toned(double exposed) {
  const double v = exposed * (1 + exposed / 16) / (1 + exposed * 0.55);
  const double srgb = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
  return std::clamp(srgb, 0.0, 1.0) * 255;
}

/// Inverts toned() where it does not clip.
double untoned(double value) {
  const double srgb = value / 255;
  const double v = srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
  const double half = 1 - 0.55 * v;  // v (1 + 0.55 e) = e (1 + e / 16)
  return 8 * (std::sqrt(half * half + v / 4) - half);
}

ToneTable tone_table() {
  ToneTable table{};
  for (int i = 0; i < kToneSteps; ++i)
    table[i] =
        static_cast<std::uint8_t>(toned(kExposure * kBrightest * i / (kToneSteps - 1)) + 0.5);
  return table;
}

const ToneTable& shared_tone_table() {
  static const ToneTable table = tone_table();
  return table;
}

}  // namespace

TexturedSurface textured_surface(const Room& room) {
  return {&room.mesh,
          room.material,
          room.surface,
          room.surface_m,
          room.light,
          room.materials,
          static_cast<float>(2 * room.detail),
          room.rays.get()};
}

ToneCurve::ToneCurve(Vec3f gain) : scale_(gain * ((kToneSteps - 1) / kBrightest)) {}

std::array<std::uint8_t, 3> ToneCurve::operator()(Vec3f light) const {
  const ToneTable& table = shared_tone_table();
  std::array<std::uint8_t, 3> out{};
  for (int c = 0; c < 3; ++c) {
    const float at = std::clamp(light[c] * scale_[c], 0.0f, kToneSteps - 1.0f);
    out[c] = table[static_cast<int>(at + 0.5f)];
  }
  return out;
}

std::array<std::uint8_t, 256> relit(double factor) {
  std::array<std::uint8_t, 256> out{};
  for (int i = 0; i < 256; ++i)
    out[i] = static_cast<std::uint8_t>(toned(untoned(i) * factor) + 0.5);
  return out;
}

PixelShader::Hit PixelShader::cast(Vec3f ray) const {
  const auto hit = surface_.rays->first_hit(origin_, ray, 0, kFarAway_m);
  return hit ? Hit{hit->triangle, hit->distance} : Hit{};
}

Vec3f PixelShader::shade(std::uint32_t triangle, Vec3f ray) const {
  const SurfacePoint at = surface_point(triangle, ray);
  return shade(triangle, at, grain_on(triangle, at.surface_m));
}

Vec3f PixelShader::albedo(std::uint32_t triangle, Vec3f ray) const {
  return paint(surface_.material_of(triangle), surface_point(triangle, ray).surface_m, 0);
}

Vec3f PixelShader::shade_pixel(std::uint32_t triangle, int x, int y) const {
  const float grain = grain_on(triangle, surface_point(triangle, camera_.ray(x, y)).surface_m);
  Vec3f sum;
  for (const Vec2d quarter : kQuarters)
    sum +=
        shade(triangle, surface_point(triangle, camera_.ray(x + quarter.x, y + quarter.y)), grain);
  return sum * 0.25f;
}

PixelShader::SurfacePoint PixelShader::surface_point(std::uint32_t t, Vec3f ray) const {
  const Triangle& corners = surface_.mesh->triangles[t];
  const std::vector<Vec3f>& positions = surface_.mesh->positions;
  const Vec3f a = positions[corners[0]];
  const Vec3f ab = positions[corners[1]] - a, ac = positions[corners[2]] - a;
  const Vec3f n = cross(ab, ac);
  const float facing = dot(n, ray);
  const float depth = facing != 0 ? dot(n, a - origin_) / facing : 0;
  const Vec3f p = origin_ + ray * depth - a;
  const float nn = dot(n, n), wb = dot(cross(p, ac), n) / nn, wc = dot(cross(ab, p), n) / nn;
  const auto mixed = [&](const auto& values) {
    return values[corners[0]] * (1 - wb - wc) + values[corners[1]] * wb + values[corners[2]] * wc;
  };
  return {mixed(surface_.surface_m), mixed(surface_.light)};
}

float PixelShader::grain_on(std::uint32_t t, Vec2f surface_m) const {
  const Material& m = surface_.material_of(t);
  return m.grain > 0 ? surface_.contrast * grain_at(m, surface_m) : 0;
}

Vec3f PixelShader::shade(std::uint32_t t, const SurfacePoint& at, float grain) const {
  const Material& m = surface_.material_of(t);
  const Vec3f color = paint(m, at.surface_m, grain);
  if (m.emission > 0) return color * m.emission;
  const Vec3f light = max(at.light, Vec3f{});
  return {color.x * light.x, color.y * light.y, color.z * light.z};
}

std::vector<std::array<std::uint8_t, 3>> vertex_colors(const TexturedSurface& surface) {
  std::vector<std::uint16_t> material(surface.mesh->positions.size());
  for (std::size_t t = 0; t < surface.mesh->triangles.size(); ++t)
    for (const std::uint32_t v : surface.mesh->triangles[t]) material[v] = surface.material[t];
  std::vector<std::array<std::uint8_t, 3>> out(material.size());
  const ToneCurve tone;
  parallel_for(out.size(), 512, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const Material& m = surface.materials[material[v]];
      const float grain = m.grain > 0 ? surface.contrast * grain_at(m, surface.surface_m[v]) : 0;
      const Vec3f color = paint(m, surface.surface_m[v], grain);
      const Vec3f light = m.emission > 0 ? Vec3f{m.emission, m.emission, m.emission}
                                         : max(surface.light[v], Vec3f{});
      out[v] = tone({color.x * light.x, color.y * light.y, color.z * light.z});
    }
  });
  return out;
}

}  // namespace mr::synth
