#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "mr/synth/interiors.h"
#include "mr/synth/pieces.h"

namespace mr::synth {
namespace {

struct LongSide {
  int wall, opposite, end, start;  ///< numbers of walls; start and end are the short ones
  double length, width;
};

LongSide long_side(const RigConfig& rig) {
  if (rig.room_m.x >= rig.room_m.y) return {0, 2, 1, 3, rig.room_m.x, rig.room_m.y};
  return {1, 3, 2, 0, rig.room_m.y, rig.room_m.x};
}

double wall_length(const RigConfig& rig, int wall) {
  return wall % 2 == 0 ? rig.room_m.x : rig.room_m.y;
}

Material terrazzo(std::uint32_t srgb) {
  Material stone = plain(srgb, 0.3f);
  stone.grain_scale = {5, 5};
  return stone;
}

void skirting_all(Builder& b, const RigConfig& rig) {
  for (int wall = 0; wall < 4; ++wall) {
    const double half = wall_length(rig, wall) / 2;
    skirting(b, rig, wall, -half, half);
  }
}

/// A fire extinguisher with its sign.
void extinguisher(Builder& b, double x) {
  const std::array<Vec2d, 5> bottle{
      {{0.001, 0.5}, {0.07, 0.5}, {0.07, 0.9}, {0.03, 0.97}, {0.02, 1.0}}};
  b.lathe({x, -0.09, 0}, bottle, 24, b.add(plain(0xC8261E, 0.05f)));
  const std::array<Vec3d, 3> hose{{{x, -0.09, 1.0}, {x + 0.09, -0.1, 0.95}, {x + 0.1, -0.1, 0.68}}};
  tube(b, hose, 0.009, b.add(plain(0x303034, 0.05f)));
  hang_picture(b, lettered("FIRE", 0xC8261E, 0xFFFFFF), 0xC8261E, x, 1.5, 0.24, 0.16, 0);
}

/// Doors with numbers along a wall; leaves the ends free.
void doors(Builder& b, const RigConfig& rig, int wall, int first_number) {
  const double length = wall_length(rig, wall);
  const int count = std::max(1, static_cast<int>((length - 1.2) / 2.8));
  for (int i = 0; i < count; ++i) {
    const double x = ((i + 0.5) / count - 0.5) * (length - 0.8);
    b.place(at_wall(rig, wall));
    door(b, rig, wall, x);
    const std::string number = std::to_string(first_number + 2 * i);
    hang_picture(b, lettered("ROOM " + number, 0x2B4A6B, 0xF5F5F2), 0x2B4A6B, x + 0.78, 1.62, 0.36,
                 0.14, 0);
  }
}

void exit_sign(Builder& b, const RigConfig& rig, int wall) {
  Material sign = lettered("EXIT ^", 0x1E7A46, 0xF5FFF5);
  sign.emission = 0.9f;
  b.place(at_wall(rig, wall));
  hang_picture(b, sign, 0xD8D8D4, 0, std::min(2.28, rig.room_m.z - 0.25), 0.5, 0.18, 0.01);
}

/// A coat that hangs from a hook: a narrow, folded sheet.
void coat(Builder& b, double x, double top, std::uint32_t color, double wide) {
  const double high = 0.95;
  Material fabric = cloth(color);
  const MaterialId sized = b.sized(b.add(fabric), wide, high);
  b.sheet(24, 16, {wide, high}, sized, [&](double u, double v) {
    const double shoulder = 0.35 + 0.65 * std::min(1.0, (1 - v) * 4);
    const double fold = 0.02 * std::sin(6 * std::numbers::pi * u) * (1.2 - v);
    const double belly = 0.07 * std::sin(std::numbers::pi * std::clamp(u, 0.0, 1.0));
    return Vec3d{x + (u - 0.5) * wide * shoulder, -0.05 - belly + fold, top - high * (1 - v)};
  });
}

void coat_rack(Builder& b) {
  const MaterialId board = b.add(timber(0xA9713F, 0x6B4222, false));
  const MaterialId brass = b.add(plain(0xC9A548, 0.05f));
  b.box({-0.8, -0.03, 1.66}, {0.8, 0.01, 1.8}, board);
  b.box({-0.8, -0.28, 1.92}, {0.8, 0.0, 1.945}, board);
  for (int i = 0; i < 6; ++i) {
    const double x = -0.7 + 0.28 * i;
    const std::array<Vec3d, 3> hook{{{x, -0.03, 1.74}, {x, -0.09, 1.72}, {x, -0.1, 1.76}}};
    tube(b, hook, 0.007, brass);
  }
  coat(b, -0.55, 1.7, 0x5A6B8A, 0.42);
  coat(b, 0.14, 1.7, 0xB5533C, 0.4);
  coat(b, 0.56, 1.7, 0x6B7A4A, 0.44);
  b.fill({-0.8, -0.2, 0.7}, {0.8, 0, 1.8});
}

/// Steps up along a wall, from left to right, with a railing.
void stairs(Builder& b, double width, int steps, double rise) {
  const MaterialId stone = b.add(terrazzo(0xC9C3B6)), tread = b.add(terrazzo(0xA79F90));
  const MaterialId metal = b.add(plain(0x4A4D52, 0.05f));
  constexpr double kGoing = 0.28;
  for (int i = 0; i < steps; ++i)
    b.box({i * kGoing, -width, 0}, {(i + 1) * kGoing, -0.0, (i + 1) * rise}, stone, tread);
  std::vector<Vec3d> rail;
  for (int i = 0; i < steps; ++i) {
    const Vec3d foot{(i + 0.5) * kGoing, -width + 0.05, (i + 1) * rise};
    const std::array<Vec3d, 2> post{{foot, foot + Vec3d{0, 0, 0.9}}};
    tube(b, post, 0.009, metal);
    rail.push_back(post[1]);
  }
  tube(b, rail, 0.02, metal);
}

void column(Builder& b, const RigConfig& rig, Vec2d place) {
  const double h = rig.room_m.z;
  const std::array<Vec2d, 8> profile{{{0.24, 0},
                                      {0.24, 0.1},
                                      {0.18, 0.14},
                                      {0.16, 0.3},
                                      {0.15, h - 0.3},
                                      {0.18, h - 0.14},
                                      {0.24, h - 0.1},
                                      {0.24, h}}};
  b.lathe({place.x, place.y, 0}, profile, 32, b.add(terrazzo(0xD8CFBC)));
}

}  // namespace

void corridor(Builder& b, const RigConfig& rig, std::vector<Light>& lights) {
  Random random(rig.seed);
  const LongSide side = long_side(rig);
  Material floor = terrazzo(0x9FA6A0);
  Sides sides{floor, plain(0xF3F1EA, 0.05f), {}};
  for (Material& wall : sides.walls) wall = plain(0xE6E2D6, 0.07f);
  sides.walls[side.end] = plain(0x3F7C85, 0.12f);
  sides.walls[side.opposite] = plain(0xD9D3BE, 0.08f);
  six_sides(b, rig, sides);
  skirting_all(b, rig);
  const int panels = std::max(1, static_cast<int>(std::lround(side.length / 2.6)));
  ceiling_panels(b, rig, side.wall == 0 ? panels : 1, side.wall == 0 ? 1 : panels, lights);
  doors(b, rig, side.wall, 101);
  doors(b, rig, side.opposite, 102);
  exit_sign(b, rig, side.end);
  b.place(at_wall(rig, side.end));
  if (side.width >= 1.4)
    hang_picture(b, landscape(rig.seed * 7 + 1), 0x5A3A22, 0, 1.5, 0.8, 0.6, 0.04);
  b.place(at_wall(rig, side.start));
  hang_picture(b, lettered("MESHREDUCE\nTHIS WAY ^", 0xF6F1E3, 0x1B2A49), 0x2A2A2A, 0, 1.65,
               std::min(1.3, side.width - 0.4), 0.5, 0.03);
  const int doors_here = std::max(1, static_cast<int>((side.length - 1.2) / 2.8));
  const auto between = [&](int i) {  // two doors
    return (static_cast<double>(i + 1) / doors_here - 0.5) * (side.length - 0.8);
  };
  for (int i = 0; i + 1 < doors_here; ++i) {
    b.place(at_wall(rig, i % 2 == 0 ? side.wall : side.opposite, between(i)));
    if (i % 3 == 0) notice_board(b, 0.15, 1.5, 0.8, 0.6, random);
    if (i % 3 == 1) radiator(b, 0.8);
    if (i % 3 == 2) extinguisher(b, 0.1);
  }
  b.place(standing(at_wall(rig, side.start, side.width / 2 - 0.35) * Vec3d{0, -0.35, 0}, 0), 0.7);
  plant(b, random);
}

void hallway(Builder& b, const RigConfig& rig, std::vector<Light>& lights) {
  Random random(rig.seed);
  const double w = rig.room_m.x / 2, d = rig.room_m.y / 2;
  Sides sides{terrazzo(0xB9AE9A), plain(0xF3F1EA, 0.05f), {}};
  for (Material& wall : sides.walls) wall = plain(0xE9DFC8, 0.08f);
  sides.walls[1] = plain(0x6B8A5E, 0.12f);
  six_sides(b, rig, sides);
  skirting_all(b, rig);
  ceiling_panels(b, rig, std::max(1, static_cast<int>(w / 1.2)),
                 std::max(1, static_cast<int>(d / 1.2)), lights);
  b.place(at_wall(rig, 0));
  for (const double x : {-0.5, 0.5}) door(b, rig, 0, x - 0.2 * w);
  exit_sign(b, rig, 0);
  b.place(at_wall(rig, 1, -0.1 * d));
  coat_rack(b);
  b.place(at_wall(rig, 1, -0.1 * d));
  bench(b, 1.4);
  b.place(at_wall(rig, 1, std::min(d - 0.7, 1.5)));
  notice_board(b, 0, 1.5, 0.9, 0.9, random);
  constexpr int kSteps = 7;
  b.place(at_wall(rig, 2, w - kSteps * 0.28));
  stairs(b, 1.0, kSteps, 0.17);
  b.place(at_wall(rig, 2, -0.55 * w));
  hang_picture(b, lettered("WELCOME", 0xF6F1E3, 0xA3271F), 0x6B4A2E, 0, 1.8, std::min(1.5, w), 0.4,
               0.03);
  b.place(at_wall(rig, 3));
  hang_picture(b, landscape(rig.seed * 7 + 2), 0xC7A252, -0.3 * d, 1.55, 1.0, 0.7, 0.05);
  hang_picture(b, landscape(rig.seed * 7 + 3), 0x232323, 0.45 * d, 1.55, 0.6, 0.8, 0.04);
  b.place({});
  if (w > 2.3 && d > 2.3)
    for (const double x : {-0.55, 0.55}) column(b, rig, {x * w, 0.62 * d});
  b.place(standing({-w + 0.5, -d + 0.5, 0}, 0));
  plant(b, random);
  b.place(at_wall(rig, 1, -0.1 * d - 1.05));
  bin(b, {0, -0.25, 0});  // for umbrellas
  const MaterialId umbrella = b.add(plain(0x8A2E3C, 0.1f));
  const std::array<Vec3d, 2> stick{{{0.05, -0.25, 0.02}, {0.1, -0.2, 0.8}}};
  tube(b, stick, 0.02, umbrella);
  if (rig.detail > 0.3) {
    b.place(standing({-w + 0.45, 0.1 * d, 0}, 12), 0.8);
    carton(b);
  }
}

}  // namespace mr::synth
