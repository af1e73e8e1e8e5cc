#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "mr/synth/interiors.h"
#include "mr/synth/pieces.h"

namespace mr::synth {
namespace {

void dining_place(Builder& b, const RigConfig& rig, Vec3d place, double scale, Random& random) {
  Material pattern = plain(0x8C2F2B, 0.35f);
  pattern.pattern = Pattern::rug;
  pattern.accent = linear_color(0xE3D2AC);
  pattern.size_m = {2.7f, 2.1f};
  pattern.grain_scale = {4, 4};
  const MaterialId rug = b.add(pattern);
  b.place(standing(place, 4), scale);
  b.box({-1.35, -1.05, 0}, {1.35, 1.05, 0.012}, rug);
  const Pose T_room_table = standing(place, 7);
  const Pose on_rug = standing({0, 0, 0.012}, 0);
  b.place(T_room_table * on_rug, scale);
  table(b);
  fruit_bowl(b, {-0.1, 0.08, 0.74});
  cup(b, {0.28, -0.2, 0.74}, 0.042, 0.095, 0xD8D3C8);
  cup(b, {-0.55, -0.22, 0.74}, 0.042, 0.095, 0xB23A2E);
  laptop(b, {0.5, 0.12, 0.74});
  if (rig.detail > 0.2) books_lying(b, {-0.6, 0.18, 0.74}, 3, random);
  const std::array<Vec3d, 4> seats{
      {{-0.42, 0.62, 0}, {0.45, 0.7, 0}, {-0.4, -0.66, 0}, {0.5, -0.6, 0}}};
  const std::array<std::uint32_t, 4> colors{0x2F6F73, 0xC2703D, 0xC2703D, 0x2F6F73};
  for (int i = 0; i < 4; ++i) {
    const double yaw = (i < 2 ? 0 : 180) + random.uniform(-14, 14);
    b.place(T_room_table * standing(seats[i] * scale + Vec3d{0, 0, 0.012}, yaw), scale);
    chair(b, colors[i]);
  }
}

void table_lamp(Builder& b, const Pose& T_room_wall, double scale, std::vector<Light>& lights) {
  const Vec3d foot{-0.55, -0.22, 0.83};
  const std::array<Vec2d, 6> stand{
      {{0.001, 0}, {0.075, 0}, {0.08, 0.02}, {0.055, 0.12}, {0.02, 0.2}, {0.012, 0.27}}};
  b.lathe(foot, stand, 24, b.add(plain(0x3E6C64, 0.1f)));
  Material paper = plain(0xFFDFA8, 0.05f);
  paper.emission = 1.15f;
  const std::array<Vec2d, 2> shade{{{0.15, 0.24}, {0.1, 0.45}}};
  b.lathe(foot, shade, 32, b.add(paper));
  const double r = 0.08 * scale;
  lights.push_back({T_room_wall * ((foot + Vec3d{0, 0, 0.34}) * scale),
                    {r, 0, 0},
                    {0, 0, r},
                    {0.30f, 0.20f, 0.10f}});
}

/// Hangs over the table.
void pendant(Builder& b, const RigConfig& rig, Vec3d place, double scale,
             std::vector<Light>& lights) {
  const double ceiling = rig.room_m.z / scale, low = std::max(ceiling - 0.85, 1.5);
  b.place(standing(place, 0), scale);
  const MaterialId dark = b.add(plain(0x2A2A2C, 0.1f));
  const std::array<Vec2d, 2> cord{{{0.007, 0}, {0.007, ceiling - low - 0.2}}};
  b.lathe({0, 0, low + 0.2}, cord, 12, dark);
  const std::array<Vec2d, 6> shade{
      {{0.2, 0.0}, {0.24, 0.003}, {0.2, 0.1}, {0.1, 0.18}, {0.03, 0.22}, {0.002, 0.222}}};
  b.lathe({0, 0, low}, shade, 40, b.add(plain(0xC8573B, 0.08f)));
  const std::array<Vec2d, 4> inside{{{0.002, 0.2}, {0.09, 0.165}, {0.19, 0.09}, {0.235, 0.003}}};
  Material lit = plain(0xFFEFD0, 0.0f);
  lit.emission = 1.3f;
  const MaterialId glow = b.add(lit);
  b.lathe({0, 0, low}, inside, 40, glow);
  b.sphere({0, 0, low + 0.07}, 0.06, glow);
  const double r = 0.09 * scale;
  lights.push_back(
      {place + Vec3d{0, 0, low * scale - 0.02}, {r, 0, 0}, {0, r, 0}, {0.80f, 0.66f, 0.46f}});
}

Sides room_sides(const RigConfig& rig) {
  Material boards = plain(0xB07B4A, 0.42f);
  boards.pattern = Pattern::planks;
  boards.accent = linear_color(0x3A2415);
  boards.grain_scale = {1.0f, 7.0f};
  boards.seed = rig.seed;
  const Material wall = plain(0xE9E1D0, 0.07f);
  return {
      boards, plain(0xF3F1EA, 0.06f), {wall, plain(0x3F7C85, 0.12f), wall, plain(0xD9B56D, 0.1f)}};
}

void room_shell(Builder& b, const RigConfig& rig, std::vector<Light>& lights) {
  const double w = rig.room_m.x, d = rig.room_m.y, eye = std::min(1.62, rig.room_m.z * 0.56);
  const double s = furniture_scale(rig), door_x = w / 2 - 1.15;
  six_sides(b, rig, room_sides(rig));
  skirting(b, rig, 0, -w / 2, door_x - 0.54);
  skirting(b, rig, 0, door_x + 0.54, w / 2);
  for (const int wall : {1, 3}) skirting(b, rig, wall, -d / 2, d / 2);
  skirting(b, rig, 2, -w / 2, w / 2);

  b.place(at_wall(rig, 0));
  window(b, rig, -0.12 * w, lights);
  door(b, rig, 0, door_x);

  b.place(at_wall(rig, 1), s);
  hang_picture(b, lettered("MESHREDUCE", 0xF6F1E3, 0x1B2A49), 0x2A2A2A, 0.0, 1.95, 1.7, 0.42, 0.03);
  Material board = plain(0xF5F5F2, 0.03f);
  board.pattern = Pattern::checker;
  board.accent = linear_color(0x151515);
  hang_picture(b, board, 0x2A2A2A, 1.3, eye - 0.2, 0.6, 0.42, 0.02);
  hang_picture(b, landscape(rig.seed * 7 + 1), 0x5A3A22, -1.35, eye - 0.15, 0.6, 0.8, 0.05);

  b.place(at_wall(rig, 2), s);
  hang_picture(b, landscape(rig.seed * 7 + 2), 0xC7A252, -0.55, eye, 0.9, 0.6, 0.05);
  hang_picture(b, landscape(rig.seed * 7 + 3), 0x232323, 0.45, eye, 0.55, 0.6, 0.04);
  hang_picture(b, lettered("^ ^\nTHIS\nWAY UP", 0xE9B93A, 0x201A12), 0x201A12, 1.6, eye - 0.1, 0.75,
               0.95, 0.0);

  b.place(at_wall(rig, 3), s);
  hang_picture(b, lettered("THIS WAY UP ^", 0xF2EEE4, 0xA3271F), 0x6B4A2E, -0.35, 1.7, 1.35, 0.34,
               0.03);
  hang_picture(b, landscape(rig.seed * 7 + 5), 0x6B4A2E, 1.25, eye - 0.1, 0.62, 0.46, 0.04);
}

void furnish_room(Builder& b, const RigConfig& rig, std::vector<Light>& lights) {
  Random random(rig.seed);
  const double s = furniture_scale(rig), w = rig.room_m.x / 2, d = rig.room_m.y / 2;
  const Vec3d table_place{0.15 * s, 0.3 * s, 0};
  dining_place(b, rig, table_place, s, random);
  pendant(b, rig, table_place, s, lights);

  b.place(at_wall(rig, 1), s);
  bookshelf(b, rig.detail, random);
  b.place(at_wall(rig, 2), s);
  sofa(b);
  const Pose T_room_sideboard = at_wall(rig, 3, -0.2 * s);
  b.place(T_room_sideboard, s);
  sideboard(b);
  table_lamp(b, T_room_sideboard, s, lights);
  cup(b, {0.1, -0.2, 0.83}, 0.06, 0.22, 0xC9C2B0);
  books_lying(b, {0.5, -0.22, 0.83}, 2 + static_cast<int>(3 * rig.detail), random);

  b.place(standing({w - 0.55 * s, -d + 0.55 * s, 0}, 0), s);
  plant(b, random);
  b.place(standing({-w + 0.6 * s, d - 0.6 * s, 0}, 25), s);
  carton(b);
  b.place({}, s);
  ball(b, {-1.55, -0.75, 0}, 0.16, 0xC8352B, 0xF2EEE4);
  ball(b, {1.75, -1.35, 0}, 0.11, 0x2E6FB0, 0xF0C23B);
  toys(b, Vec3d{-1.75, 0.95, 0} * s, static_cast<int>(std::lround(14 * rig.detail)), s, random);
}

}  // namespace

void living_room(Builder& b, const RigConfig& rig, std::vector<Light>& lights) {
  room_shell(b, rig, lights);
  furnish_room(b, rig, lights);
}

}  // namespace mr::synth
