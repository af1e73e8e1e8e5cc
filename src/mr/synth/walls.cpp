#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "mr/synth/doorway.h"
#include "mr/synth/pieces.h"
#include "mr/synth/props.h"

namespace mr::synth {
namespace {

/// Curtain: a wavy sheet that hangs from `top` to `bottom`.
void curtain(Builder& b, double left, double width, double bottom, double top, MaterialId cloth) {
  const double folds = std::round(width / 0.11);
  const MaterialId sized = b.sized(cloth, width, top - bottom);
  b.sheet(static_cast<int>(folds) * 8, 24, {width, top - bottom}, sized, [&](double u, double v) {
    const double depth = 0.035 * std::sin(2 * std::numbers::pi * folds * u) * (1.15 - 0.4 * v);
    return Vec3d{left + width * u, -0.1 - depth, bottom + (top - bottom) * v};
  });
}

}  // namespace

Material lettered(const std::string& text, std::uint32_t paper, std::uint32_t ink) {
  Material m = plain(paper, 0.05f);
  m.pattern = Pattern::text;
  m.text = text;
  m.accent = linear_color(ink);
  return m;
}

Material landscape(std::uint32_t seed) {
  Material m = plain(0xFFFFFF, 0.12f);
  m.pattern = Pattern::picture;
  m.seed = seed;
  return m;
}

void hang_picture(Builder& b, Material front, std::uint32_t rim_color, double x, double z,
                  double width, double height, double rim_m) {
  const MaterialId rim = b.add(plain(rim_color, 0.15f));
  front.size_m = {static_cast<float>(width), static_cast<float>(height)};
  const double depth = 0.025, left = x - width / 2, low = z - height / 2;
  if (rim_m > 0) {
    b.box({left - rim_m, -depth - 0.008, low - rim_m}, {left, 0.01, low + height + rim_m}, rim);
    b.box({left + width, -depth - 0.008, low - rim_m},
          {left + width + rim_m, 0.01, low + height + rim_m}, rim);
    b.box({left, -depth - 0.008, low - rim_m}, {left + width, 0.01, low}, rim);
    b.box({left, -depth - 0.008, low + height}, {left + width, 0.01, low + height + rim_m}, rim);
  }
  const MaterialId face = b.add(std::move(front));
  b.box({left, -depth, low}, {left + width, 0.01, low + height}, face, rim);
}

void window(Builder& b, const RigConfig& rig, double x, std::vector<Light>& lights) {
  const double width = 1.5, low = 0.95, high = std::min(2.2, rig.room_m.z - 0.35);
  const double height = high - low, middle = (low + high) / 2;
  Material view = landscape(rig.seed * 13 + 4);
  view.emission = 1.9f;
  view.grain = 0;
  hang_picture(b, view, 0xF2EFE8, x, middle, width, height, 0.07);
  const MaterialId white = b.add(plain(0xF2EFE8, 0.1f));
  b.box({x - 0.025, -0.045, low}, {x + 0.025, -0.02, high}, white);
  b.box({x - width / 2, -0.04, middle + 0.2}, {x + width / 2, -0.02, middle + 0.24}, white);
  b.box({x - width / 2 - 0.12, -0.2, low - 0.11}, {x + width / 2 + 0.12, 0.01, low - 0.07}, white);
  Material cloth = plain(0xB5533C, 0.25f);
  cloth.grain_scale = {6, 0.6f};
  const MaterialId fabric = b.add(cloth);
  curtain(b, x - width / 2 - 0.42, 0.44, 0.12, high + 0.13, fabric);
  curtain(b, x + width / 2 - 0.02, 0.44, 0.12, high + 0.13, fabric);
  const MaterialId rail = b.add(plain(0x3A3532, 0.1f));
  b.box({x - width / 2 - 0.5, -0.115, high + 0.12}, {x + width / 2 + 0.5, -0.085, high + 0.15},
        rail);
  const Pose T = at_wall(rig, 0);
  lights.push_back({T * Vec3d{x, -0.22, middle},
                    T.rotation * Vec3d{width / 2, 0, 0},
                    T.rotation * Vec3d{0, 0, height / 2},
                    {2.35f, 2.5f, 2.75f},
                    Light::Kind::window});
}

void door(Builder& b, const RigConfig& rig, int wall, double x) {
  const MaterialId frame = b.add(plain(0xEDE8DC, 0.08f));
  Material leaf = plain(0x8F5B34, 0.3f);
  leaf.grain_scale = {9, 0.8f};
  const MaterialId wood = b.add(leaf);
  const double w = kDoorway_m.x, h = kDoorway_m.y;
  b.box({x - w / 2 - 0.09, -0.03, 0}, {x - w / 2, 0.01, h + 0.09}, frame);
  b.box({x + w / 2, -0.03, 0}, {x + w / 2 + 0.09, 0.01, h + 0.09}, frame);
  b.box({x - w / 2, -0.03, h}, {x + w / 2, 0.01, h + 0.09}, frame);
  const auto doorway = doorway_of(rig);
  if (doorway && doorway->wall == wall && doorway->x == x) {  // its leaf moves: a prop
    b.fill({x - w / 2, -0.015, 0}, {x + w / 2, 0.01, h});
    return vestibule(b, *doorway);
  }
  b.box({x - w / 2, -0.015, 0}, {x + w / 2, 0.01, h}, wood);
  for (const double z : {0.2, 1.15}) b.box({x - 0.3, -0.032, z}, {x + 0.3, -0.01, z + 0.72}, wood);
  Material brass = plain(0xC9A548, 0.05f);
  b.sphere({x + w / 2 - 0.07, -0.07, 1.02}, 0.03, b.add(brass));
}

void notice_board(Builder& b, double x, double z, double width, double height, Random& random) {
  Material cork = plain(0xB98A57, 0.5f);
  cork.grain_scale = {6, 6};
  hang_picture(b, cork, 0x5A3A22, x, z, width, height, 0.03);
  constexpr const char* kNotes[] = {
      "NO PARKING",          "FOR RENT\n2 ROOMS",     "CHOIR\nMONDAY 8",
      "LOST CAT\nCALL 4711", "MENU\nSOUP 3\nPASTA 7", "YOGA ^\nROOM 12"};
  const int columns = std::max(1, static_cast<int>(width / 0.3));
  for (int i = 0; i < columns; ++i)
    for (const double row : {0.25, -0.25}) {
      Material note = lettered(kNotes[random.index(6)], i % 2 == 0 ? 0xF6F1E3 : 0xF3E27A, 0x1B2A49);
      const double w = random.uniform(0.16, 0.22), h = random.uniform(0.18, 0.26);
      const double left = x - width / 2 + (i + 0.5) * width / columns - w / 2;
      note.size_m = {static_cast<float>(w), static_cast<float>(h)};
      b.box({left, -0.03, z + row * height - h / 2}, {left + w, -0.02, z + row * height + h / 2},
            b.add(note));
    }
}

void six_sides(Builder& b, const RigConfig& rig, const Sides& sides) {
  const double w = rig.room_m.x, d = rig.room_m.y, h = rig.room_m.z;
  b.place({});
  b.panel({-w / 2, -d / 2, 0}, {w, 0, 0}, {0, d, 0}, b.add(sides.floor));
  b.panel({-w / 2, d / 2, h}, {w, 0, 0}, {0, -d, 0}, b.add(sides.ceiling));
  const auto doorway = doorway_of(rig);
  const auto wall = [&](int number, Vec3d corner, Vec3d right) {
    const MaterialId material = b.add(sides.walls[number]);
    const Vec3d up{0, 0, h};
    if (!doorway || doorway->wall != number) return b.panel(corner, right, up, material);
    const double length_m = length(right), middle = doorway->x / length_m + 0.5,
                 half = kDoorway_m.x / 2 / length_m, lintel = kDoorway_m.y / h;
    const Vec3d from = right * (middle - half), to = right * (middle + half);
    b.panel(corner, from, up, material);
    b.panel(corner + from + up * lintel, to - from, up * (1 - lintel), material);
    b.panel(corner + to, right - to, up, material);
  };
  wall(0, {-w / 2, d / 2, 0}, {w, 0, 0});
  wall(1, {w / 2, d / 2, 0}, {0, -d, 0});
  wall(2, {w / 2, -d / 2, 0}, {-w, 0, 0});
  wall(3, {-w / 2, -d / 2, 0}, {0, d, 0});
}

void skirting(Builder& b, const RigConfig& rig, int wall, double left, double right) {
  const MaterialId white = b.add(plain(0xEDE8DC, 0.08f));
  b.place(at_wall(rig, wall));
  const auto piece = [&](double from, double to) {
    if (from < to) b.box({from, -0.016, 0}, {to, 0.01, 0.085}, white);
  };
  const auto doorway = doorway_of(rig);
  if (!doorway || doorway->wall != wall) return piece(left, right);
  piece(left, std::min(right, doorway->x - kDoorway_m.x / 2));
  piece(std::max(left, doorway->x + kDoorway_m.x / 2), right);
}

void ceiling_panels(Builder& b, const RigConfig& rig, int columns, int rows,
                    std::vector<Light>& lights) {
  constexpr double kLong = 0.6, kWide = 0.15, kThick = 0.03;  // half sizes
  Material shining = plain(0xFFFAF0, 0);
  shining.emission = 1.5f;
  const MaterialId glow = b.add(shining), rim = b.add(plain(0xD8D8D4, 0.05f));
  const bool along_x = rig.room_m.x >= rig.room_m.y;
  const Vec3d half = along_x ? Vec3d{kLong, kWide, 0} : Vec3d{kWide, kLong, 0};
  const double z = rig.room_m.z - kThick;
  const auto power = static_cast<float>(0.048 * rig.room_m.x * rig.room_m.y / (columns * rows) *
                                        std::clamp(rig.room_m.z / 2.8, 0.7, 1.6));
  b.place({});
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const Vec3d c{((i + 0.5) / columns - 0.5) * rig.room_m.x,
                    ((j + 0.5) / rows - 0.5) * rig.room_m.y, z};
      b.box({c.x - half.x, c.y - half.y, z}, {c.x + half.x, c.y + half.y, z + kThick + 0.005}, rim);
      b.panel({c.x - half.x + 0.02, c.y + half.y - 0.02, z - 0.002}, {2 * half.x - 0.04, 0, 0},
              {0, 0.04 - 2 * half.y, 0}, glow);
      lights.push_back({c - Vec3d{0, 0, 0.02},
                        {half.x, 0, 0},
                        {0, -half.y, 0},
                        Vec3f{1.0f, 0.97f, 0.92f} * (power * 10),
                        Light::Kind::panel});
    }
}

}  // namespace mr::synth
