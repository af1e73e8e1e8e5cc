#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "mr/core/mesh.h"
#include "mr/kit/raycast.h"
#include "mr/synth/posed_camera.h"
#include "mr/synth/room.h"

namespace mr::synth {

inline constexpr std::uint32_t kNothing = 0xFFFFFFFFu;

/// A textured and lit triangle mesh for ray casting: a room or its people. A view of its owner's
/// arrays, which are laid out as in Room.
struct TexturedSurface {
  const Mesh* mesh = nullptr;
  std::span<const std::uint16_t> material;  // [T]
  std::span<const std::uint32_t> surface;   // [T]
  std::span<const Vec2f> surface_m;         // [V]
  std::span<const Vec3f> light;             // [V]
  std::span<const Material> materials;
  float contrast = 1;  ///< of the 1/f noise
  const kit::RayScene* rays = nullptr;

  const Material& material_of(std::uint32_t triangle) const {
    return materials[material[triangle]];
  }
};

TexturedSurface textured_surface(const Room& room);

/// The camera response from linear light to 8-bit sRGB: gain per channel and a soft shoulder.
class ToneCurve {
 public:
  explicit ToneCurve(Vec3f gain = {1, 1, 1});

  std::array<std::uint8_t, 3> operator()(Vec3f light) const;

 private:
  Vec3f scale_;
};

/// A lookup table of 8-bit values under `factor` times the light: inverse tone curve, scale, tone
/// curve.
std::array<std::uint8_t, 256> relit(double factor);

/// Casts and shades the pixels of one camera on a textured surface.
class PixelShader {
 public:
  /// Both must outlive this.
  PixelShader(const TexturedSurface& surface, const PosedCamera& eye)
      : surface_(surface), camera_(eye), origin_(eye.origin()) {}

  struct Hit {
    std::uint32_t triangle = kNothing;
    float distance = 0;  ///< along the pixel's ray
  };
  Hit cast(Vec3f ray) const;

  /// Radiance at the intersection of a ray with the plane of a triangle.
  Vec3f shade(std::uint32_t triangle, Vec3f ray) const;

  /// Base colour (albedo) there, with its pattern.
  Vec3f albedo(std::uint32_t triangle, Vec3f ray) const;

  /// Mean radiance of a pixel by 2x2 supersampling, all samples on the plane of one triangle.
  Vec3f shade_pixel(std::uint32_t triangle, int x, int y) const;

  const TexturedSurface& surface() const { return surface_; }
  const PosedCamera& camera() const { return camera_; }

 private:
  struct SurfacePoint {
    Vec2f surface_m;
    Vec3f light;
  };
  SurfacePoint surface_point(std::uint32_t triangle, Vec3f ray) const;
  float grain_on(std::uint32_t triangle, Vec2f surface_m) const;
  Vec3f shade(std::uint32_t triangle, const SurfacePoint& at, float grain) const;

  const TexturedSurface& surface_;
  const PosedCamera& camera_;
  const Vec3f origin_;
};

/// Sample positions of 2x2 supersampling, relative to the pixel's centre.
inline constexpr std::array<Vec2d, 4> kQuarters{
    {{-0.25, -0.25}, {0.25, -0.25}, {-0.25, 0.25}, {0.25, 0.25}}};

/// The colour of every vertex of a surface under a neutral camera, [V].
std::vector<std::array<std::uint8_t, 3>> vertex_colors(const TexturedSurface& surface);

}  // namespace mr::synth
