#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "mr/synth/furniture.h"

namespace mr::synth {
namespace {

Material plain(std::uint32_t srgb, float grain = 0.1f) {
  Material m;
  m.color = linear_color(srgb);
  m.grain = grain;
  return m;
}

/// A picture or poster that hangs on the wall in whose frame the builder stands, with a rim.
void hang(Builder& b, Material front, std::uint32_t rim_color, double x, double z, double width,
          double height, double rim_m) {
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

Material lettered(const char* text, std::uint32_t paper, std::uint32_t ink) {
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

/// Curtain: a wavy sheet that hangs from `top` to `bottom`.
void curtain(Builder& b, double left, double width, double bottom, double top, MaterialId cloth) {
  const double folds = std::round(width / 0.11);
  const MaterialId sized = b.sized(cloth, width, top - bottom);
  b.sheet(static_cast<int>(folds) * 8, 24, {width, top - bottom}, sized, [&](double u, double v) {
    const double depth = 0.035 * std::sin(2 * std::numbers::pi * folds * u) * (1.15 - 0.4 * v);
    return Vec3d{left + width * u, -0.1 - depth, bottom + (top - bottom) * v};
  });
}

void window(Builder& b, const RigConfig& rig, double x, std::vector<Light>& lights) {
  const double width = 1.5, low = 0.95, high = std::min(2.2, rig.room_m.z - 0.35);
  const double height = high - low, middle = (low + high) / 2;
  Material view = landscape(rig.seed * 13 + 4);
  view.emission = 1.9f;
  view.grain = 0;
  hang(b, view, 0xF2EFE8, x, middle, width, height, 0.07);
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
                    true});
}

void door(Builder& b, double x) {
  const MaterialId frame = b.add(plain(0xEDE8DC, 0.08f));
  Material leaf = plain(0x8F5B34, 0.3f);
  leaf.grain_scale = {9, 0.8f};
  const MaterialId wood = b.add(leaf);
  const double w = 0.9, h = 2.02;
  b.box({x - w / 2 - 0.09, -0.03, 0}, {x - w / 2, 0.01, h + 0.09}, frame);
  b.box({x + w / 2, -0.03, 0}, {x + w / 2 + 0.09, 0.01, h + 0.09}, frame);
  b.box({x - w / 2, -0.03, h}, {x + w / 2, 0.01, h + 0.09}, frame);
  b.box({x - w / 2, -0.015, 0}, {x + w / 2, 0.01, h}, wood);
  for (const double z : {0.2, 1.15}) b.box({x - 0.3, -0.032, z}, {x + 0.3, -0.01, z + 0.72}, wood);
  Material brass = plain(0xC9A548, 0.05f);
  b.sphere({x + w / 2 - 0.07, -0.07, 1.02}, 0.03, b.add(brass));
}

void six_sides(Builder& b, const RigConfig& rig) {
  const double w = rig.room_m.x, d = rig.room_m.y, h = rig.room_m.z;
  const MaterialId wall = b.add(plain(0xE9E1D0, 0.07f)), teal = b.add(plain(0x3F7C85, 0.12f)),
                   ochre = b.add(plain(0xD9B56D, 0.1f)), ceiling = b.add(plain(0xF3F1EA, 0.06f));
  Material boards = plain(0xB07B4A, 0.42f);
  boards.pattern = Pattern::planks;
  boards.accent = linear_color(0x3A2415);
  boards.grain_scale = {1.0f, 7.0f};
  boards.seed = rig.seed;
  b.place({});
  b.panel({-w / 2, -d / 2, 0}, {w, 0, 0}, {0, d, 0}, b.add(boards));
  b.panel({-w / 2, d / 2, h}, {w, 0, 0}, {0, -d, 0}, ceiling);
  b.panel({-w / 2, d / 2, 0}, {w, 0, 0}, {0, 0, h}, wall);
  b.panel({w / 2, d / 2, 0}, {0, -d, 0}, {0, 0, h}, teal);
  b.panel({w / 2, -d / 2, 0}, {-w, 0, 0}, {0, 0, h}, wall);
  b.panel({-w / 2, -d / 2, 0}, {0, d, 0}, {0, 0, h}, ochre);
}

void skirting(Builder& b, const RigConfig& rig, int wall, double left, double right) {
  const MaterialId white = b.add(plain(0xEDE8DC, 0.08f));
  b.place(at_wall(rig, wall));
  b.box({left, -0.016, 0}, {right, 0.01, 0.085}, white);
}

}  // namespace

Pose standing(Vec3d place, double yaw_degrees) {
  const double a = yaw_degrees * std::numbers::pi / 180;
  const double c = std::cos(a), s = std::sin(a);
  return {{{c, -s, 0, s, c, 0, 0, 0, 1}}, place};
}

Pose at_wall(const RigConfig& rig, int wall, double right_m) {
  const double w = rig.room_m.x / 2, d = rig.room_m.y / 2;
  const Vec3d feet[] = {{0, d, 0}, {w, 0, 0}, {0, -d, 0}, {-w, 0, 0}};
  const Pose T = standing(feet[wall], -90.0 * wall);
  return {T.rotation, T * Vec3d{right_m, 0, 0}};
}

void build_shell(Builder& b, const RigConfig& rig, std::vector<Light>& lights) {
  const double w = rig.room_m.x, d = rig.room_m.y, eye = std::min(1.62, rig.room_m.z * 0.56);
  const double s = furniture_scale(rig), door_x = w / 2 - 1.15;
  six_sides(b, rig);
  skirting(b, rig, 0, -w / 2, door_x - 0.54);
  skirting(b, rig, 0, door_x + 0.54, w / 2);
  for (const int wall : {1, 3}) skirting(b, rig, wall, -d / 2, d / 2);
  skirting(b, rig, 2, -w / 2, w / 2);

  b.place(at_wall(rig, 0));
  window(b, rig, -0.12 * w, lights);
  door(b, door_x);

  b.place(at_wall(rig, 1), s);
  hang(b, lettered("MESHREDUCE", 0xF6F1E3, 0x1B2A49), 0x2A2A2A, 0.0, 1.95, 1.7, 0.42, 0.03);
  Material board = plain(0xF5F5F2, 0.03f);
  board.pattern = Pattern::checker;
  board.accent = linear_color(0x151515);
  hang(b, board, 0x2A2A2A, 1.3, eye - 0.2, 0.6, 0.42, 0.02);
  hang(b, landscape(rig.seed * 7 + 1), 0x5A3A22, -1.35, eye - 0.15, 0.6, 0.8, 0.05);

  b.place(at_wall(rig, 2), s);
  hang(b, landscape(rig.seed * 7 + 2), 0xC7A252, -0.55, eye, 0.9, 0.6, 0.05);
  hang(b, landscape(rig.seed * 7 + 3), 0x232323, 0.45, eye, 0.55, 0.6, 0.04);
  hang(b, lettered("^ ^\nTHIS\nWAY UP", 0xE9B93A, 0x201A12), 0x201A12, 1.6, eye - 0.1, 0.75, 0.95,
       0.0);

  b.place(at_wall(rig, 3), s);
  hang(b, lettered("THIS WAY UP ^", 0xF2EEE4, 0xA3271F), 0x6B4A2E, -0.35, 1.7, 1.35, 0.34, 0.03);
  hang(b, landscape(rig.seed * 7 + 5), 0x6B4A2E, 1.25, eye - 0.1, 0.62, 0.46, 0.04);
}

}  // namespace mr::synth
