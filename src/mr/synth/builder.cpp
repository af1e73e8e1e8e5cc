#include "mr/synth/builder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace mr::synth {
namespace {

constexpr double kCell = 0.06;  // edge of the mesh on flat faces, metres: the light's resolution
constexpr double kLightInset = 0.012;  // light is gathered this far off the face and its borders

int cells(double length_m) {
  return std::max(1, static_cast<int>(std::ceil(length_m / kCell - 1e-6)));
}

/// Faces that share an edge compute its vertices along different ways: a fine grid makes them
/// equal.
Vec3d rounded(Vec3d p) {
  constexpr double kPerMetre = 1 << 20;
  const auto one = [](double v) { return std::floor(v * kPerMetre + 0.5) / kPerMetre; };
  return {one(p.x), one(p.y), one(p.z)};
}

}  // namespace

MaterialId Builder::add(Material material) {
  MR_ASSERT(room_.materials.size() < 0xFFFF);
  material.seed += static_cast<std::uint32_t>(room_.materials.size()) * 977;
  room_.materials.push_back(std::move(material));
  return static_cast<MaterialId>(room_.materials.size() - 1);
}

MaterialId Builder::sized(MaterialId material, double width_m, double height_m) {
  Material copy = room_.materials[material];
  copy.size_m = {static_cast<float>(width_m), static_cast<float>(height_m)};
  return add(std::move(copy));
}

void Builder::place(const Pose& T_room_object, double scale) {
  T_room_object_ = T_room_object;
  T_world_object_ = room_.T_world_room * T_room_object;
  scale_ = scale;
}

Vec3d Builder::to_world(Vec3d p_object) const {
  return T_world_object_ * rounded(p_object * scale_);
}

void Builder::sheet(int columns, int rows, Vec2d size_m, MaterialId material,
                    const std::function<Vec3d(double, double)>& shape) {
  const auto base = static_cast<std::uint32_t>(room_.mesh.positions.size());
  const double inset_u = std::min(0.3, kLightInset / (size_m.x * scale_));
  const double inset_v = std::min(0.3, kLightInset / (size_m.y * scale_));
  for (int j = 0; j <= rows; ++j)
    for (int i = 0; i <= columns; ++i) {
      const double u = static_cast<double>(i) / columns, v = static_cast<double>(j) / rows;
      room_.mesh.positions.push_back(vec_cast<float>(to_world(shape(u, v))));
      room_.surface_m.push_back(
          {static_cast<float>(u * size_m.x), static_cast<float>(v * size_m.y)});
      const double cu = std::clamp(u, inset_u, 1 - inset_u),
                   cv = std::clamp(v, inset_v, 1 - inset_v);
      constexpr double h = 1e-3;
      const Vec3d du = shape(cu + h, cv) - shape(cu - h, cv),
                  dv = shape(cu, cv + h) - shape(cu, cv - h);
      const Vec3d normal = T_world_object_.rotation * normalized(cross(du, dv));
      normals_.push_back(vec_cast<float>(normal));
      light_places_.push_back(vec_cast<float>(T_world_object_ * (shape(cu, cv) * scale_) +
                                              normal * (0.4 * kLightInset)));
    }
  const auto at = [&](int i, int j) {
    return base + static_cast<std::uint32_t>(j * (columns + 1) + i);
  };
  const auto add_triangle = [&](const Triangle& t) {
    room_.mesh.triangles.push_back(t);
    const Vec3f normal = room_.mesh.area_normal(room_.mesh.triangles.size() - 1);
    if (dot(normal, normal) == 0) room_.mesh.triangles.pop_back();  // at a pole
  };
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      add_triangle({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      add_triangle({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  room_.albedo.resize(room_.mesh.triangles.size(), room_.materials[material].color);
  room_.material.resize(room_.mesh.triangles.size(), material);
  room_.surface.resize(room_.mesh.triangles.size(), surfaces_++);
}

void Builder::panel(Vec3d corner, Vec3d right, Vec3d up, MaterialId material) {
  const Vec2d size{length(right), length(up)};
  sheet(cells(size.x * scale_), cells(size.y * scale_), size, material,
        [&](double u, double v) { return corner + right * u + up * v; });
}

void Builder::fill(Vec3d low, Vec3d high) {
  room_.blocks.push_back({T_room_object_, low * scale_, high * scale_});
}

void Builder::box(Vec3d low, Vec3d high, MaterialId sides, MaterialId top) {
  fill(low, high);
  const Vec3d size = high - low;
  const Vec3d x{size.x, 0, 0}, y{0, size.y, 0}, z{0, 0, size.z};
  panel({high.x, low.y, low.z}, y, z, sides);
  panel({low.x, high.y, low.z}, -y, z, sides);
  panel({high.x, high.y, low.z}, -x, z, sides);
  panel(low, x, z, sides);
  panel({low.x, low.y, high.z}, x, y, top);
  panel({low.x, high.y, low.z}, x, -y, top);
}

void Builder::lathe(Vec3d foot, std::span<const Vec2d> profile, int sides, MaterialId material) {
  std::vector<double> along{0};
  double widest = 0;
  for (std::size_t i = 0; i < profile.size(); ++i) {
    widest = std::max(widest, profile[i].x);
    if (i == 0) continue;
    const Vec2d step = profile[i] - profile[i - 1];
    along.push_back(along.back() + std::hypot(step.x, step.y));
  }
  fill(foot + Vec3d{-widest, -widest, profile.front().y},
       foot + Vec3d{widest, widest, profile.back().y});
  const int rows = static_cast<int>(profile.size()) - 1;
  const Vec2d size{2 * std::numbers::pi * widest, along.back()};
  const MaterialId wrapped = sized(material, size.x, size.y);
  sheet(sides, rows, size, wrapped, [&](double u, double v) {
    const double row = std::clamp(v, 0.0, 1.0) * rows;
    const int k = std::min(static_cast<int>(row), rows - 1);
    const Vec2d p = profile[k] + (profile[k + 1] - profile[k]) * (row - k);
    const double angle = 2 * std::numbers::pi * u;
    return foot + Vec3d{p.x * std::cos(angle), p.x * std::sin(angle), p.y};
  });
}

void Builder::sphere(Vec3d center, double radius, MaterialId material) {
  const int rings = std::clamp(static_cast<int>(radius * 220), 12, 40);
  std::vector<Vec2d> profile(rings + 1);
  for (int i = 0; i <= rings; ++i) {
    const double angle = std::numbers::pi * (static_cast<double>(i) / rings - 0.5);
    profile[i] = {radius * std::max(std::cos(angle), 0.0), radius * (1 + std::sin(angle))};
  }
  lathe(center - Vec3d{0, 0, radius}, profile, 2 * rings, material);
}

}  // namespace mr::synth
