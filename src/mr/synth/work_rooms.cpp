#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "mr/synth/interiors.h"
#include "mr/synth/pieces.h"

namespace mr::synth {
namespace {

Sides bright_sides(std::uint32_t carpet, std::uint32_t accent_wall) {
  Material floor = plain(carpet, 0.45f);
  floor.grain_scale = {6, 6};
  const Material wall = plain(0xECE8DE, 0.06f);
  return {floor, plain(0xF5F4EF, 0.05f), {wall, plain(accent_wall, 0.1f), wall, wall}};
}

void panels_for(Builder& b, const RigConfig& rig, std::vector<Light>& lights) {
  const auto count = [](double length) {
    return std::clamp(static_cast<int>(std::lround(length / 2.6)), 1, 4);
  };
  ceiling_panels(b, rig, count(rig.room_m.x), count(rig.room_m.y), lights);
}

void whiteboard(Builder& b, double x, const std::string& text) {
  Material board = lettered(text, 0xF8F8F6, 0x1B4A8A);
  board.grain = 0.02f;
  hang_picture(b, board, 0xB8BABD, x, 1.5, 1.7, 1.0, 0.025);
  const MaterialId tray = b.add(plain(0xB8BABD, 0.05f));
  b.box({x - 0.5, -0.09, 0.94}, {x + 0.5, -0.0, 0.955}, tray);
  for (int i = 0; i < 3; ++i) {
    const std::array<std::uint32_t, 3> colors{0xC8261E, 0x1B4A8A, 0x1E7A46};
    b.box({x - 0.3 + i * 0.2, -0.06, 0.955}, {x - 0.18 + i * 0.2, -0.045, 0.972},
          b.add(plain(colors[i], 0.03f)));
  }
}

void wall_screen(Builder& b, const std::string& text) {
  const MaterialId rim = b.add(plain(0x2A2A2E, 0.05f));
  b.box({-0.95, -0.07, 1.0}, {0.95, -0.01, 2.06}, rim);
  Material shown = lettered(text, 0x17407A, 0xF0F6FF);
  shown.size_m = {1.84f, 1.0f};
  shown.emission = 0.8f;
  b.panel({-0.92, -0.072, 1.03}, {1.84, 0, 0}, {0, 0, 1.0}, b.add(shown));
  const std::array<Vec3d, 4> cable{
      {{0.3, -0.03, 1.0}, {0.32, -0.02, 0.7}, {0.29, -0.02, 0.45}, {0.3, -0.01, 0.3}}};
  tube(b, cable, 0.006, b.add(plain(0x3A3A3E, 0.05f)));
}

/// Table of a length along x; frame of its own.
void long_table(Builder& b, double length) {
  const MaterialId top = b.add(timber(0xC49A66, 0x8A5F36, false));
  const MaterialId metal = b.add(plain(0x6A6D72, 0.05f));
  const double half = length / 2;
  b.box({-half, -0.55, 0.71}, {half, 0.55, 0.74}, top);
  const int frames = std::max(2, static_cast<int>(std::ceil(length / 1.8)));
  for (int i = 0; i < frames; ++i) {
    const double x = -half + 0.2 + (length - 0.4) * i / (frames - 1);
    for (const double y : {-0.45, 0.41}) b.box({x - 0.02, y, 0}, {x + 0.02, y + 0.04, 0.71}, metal);
    b.box({x - 0.02, -0.41, 0.66}, {x + 0.02, 0.41, 0.71}, metal);
  }
  b.fill({-half, -0.55, 0}, {half, 0.55, 0.74});
}

void on_long_table(Builder& b, const RigConfig& rig, double length, int seats, Random& random) {
  const std::array<std::uint32_t, 3> cups{0xD8D3C8, 0xB23A2E, 0x3F7A4B};
  for (int i = 0; i < seats; ++i) {
    const double x = ((i + 0.5) / seats - 0.5) * (length - 0.2);
    for (const double y : {-0.3, 0.3}) {
      if (random.uniform(0, 1) < rig.detail)
        paper(b, {x, y, 0.74}, random.uniform(-15, 15), random);
      if (random.uniform(0, 1) < 0.6)
        cup(b, {x + 0.25, 0.7 * y, 0.74}, 0.04, 0.09, cups[random.index(3)]);
    }
  }
  laptop(b, {-0.15 * length, 0.28, 0.74});
  fruit_bowl(b, {0.1 * length, 0.02, 0.74});
  const std::array<Vec3d, 5> cable{{{-0.15 * length + 0.17, 0.3, 0.748},
                                    {0.0, 0.12, 0.746},
                                    {0.2 * length, -0.08, 0.746},
                                    {0.4 * length, 0.02, 0.746},
                                    {0.5 * length + 0.01, 0.03, 0.735}}};
  tube(b, cable, 0.005, b.add(plain(0x3A3A3E, 0.05f)));
}

/// A desk with its things; its back to the wall.
void desk(Builder& b, const RigConfig& rig, int number, Random& random) {
  const MaterialId top = b.add(timber(0xD2B48A, 0xA98358, false));
  const MaterialId metal = b.add(plain(0x8A8D92, 0.05f)), front = b.add(plain(0xE4E0D6, 0.08f));
  b.box({-0.8, -0.82, 0.71}, {0.8, -0.04, 0.735}, top);
  for (const double x : {-0.77, 0.73})
    for (const double y : {-0.79, -0.11}) b.box({x, y, 0}, {x + 0.04, y + 0.04, 0.71}, metal);
  b.box({0.32, -0.74, 0.12}, {0.7, -0.14, 0.68}, front);
  for (const double z : {0.3, 0.48}) b.box({0.32, -0.748, z}, {0.7, -0.74, z + 0.012}, metal);
  constexpr const char* kScreens[] = {"HELLO\nWORLD", "MAIL 12\nDONE", "BUILD\nPASSED",
                                      "3D SCAN\n10 FPS"};
  monitor(b, {-0.15, -0.28, 0.735}, kScreens[number % 4]);
  b.box({-0.37, -0.66, 0.735}, {0.07, -0.52, 0.755}, b.add(plain(0x4A4D54, 0.25f)));
  b.box({0.14, -0.62, 0.735}, {0.2, -0.52, 0.76}, b.add(plain(0x4A4D54, 0.05f)));
  if (number % 2 == 0) desk_lamp(b, {0.62, -0.3, 0.735});
  cup(b, {-0.62, -0.5, 0.735}, 0.04, 0.09, bright_color(number));
  books_lying(b, {-0.6, -0.25, 0.735}, 1 + random.index(4), random);
  for (int i = 0; i < static_cast<int>(4 * rig.detail); ++i)
    paper(b, {random.uniform(-0.5, 0.5), random.uniform(-0.7, -0.6), 0.735 + 0.001 * i},
          random.uniform(-30, 30), random);
  const std::array<Vec3d, 4> cable{
      {{-0.15, -0.25, 0.76}, {-0.1, -0.08, 0.74}, {-0.1, -0.02, 0.6}, {-0.05, -0.02, 0.05}}};
  tube(b, cable, 0.004, b.add(plain(0x3A3A3E, 0.05f)));
}

/// As many desks as a wall has place for.
void desk_row(Builder& b, const RigConfig& rig, int wall, int first, Random& random) {
  const double length = wall % 2 == 0 ? rig.room_m.x : rig.room_m.y;
  const int count = std::max(1, static_cast<int>((length - 1.6) / 1.75));
  const std::array<std::uint32_t, 3> seats{0x2F6F73, 0x4E5A8A, 0xB5533C};
  for (int i = 0; i < count; ++i) {
    const double x = (i - 0.5 * (count - 1)) * 1.75;
    b.place(at_wall(rig, wall, x));
    desk(b, rig, first + i, random);
    b.place(at_wall(rig, wall, x) *
            standing({-0.12 + random.uniform(-0.1, 0.1), -1.0, 0}, 180 + random.uniform(-25, 25)));
    swivel_chair(b, seats[(first + i) % 3]);
  }
}

}  // namespace

void conference_room(Builder& b, const RigConfig& rig, std::vector<Light>& lights) {
  Random random(rig.seed);
  const bool along_x = rig.room_m.x >= rig.room_m.y;
  const double long_m = std::max(rig.room_m.x, rig.room_m.y);
  six_sides(b, rig, bright_sides(0x5E7078, 0x8FA7A0));
  for (const int wall : {1, 2, 3}) {
    const double half = (wall % 2 == 0 ? rig.room_m.x : rig.room_m.y) / 2;
    skirting(b, rig, wall, -half, half);
  }
  panels_for(b, rig, lights);
  b.place(at_wall(rig, 0));
  window(b, rig, -0.2 * rig.room_m.x / 2, lights);

  // The table stands towards one end; the other is free for who presents.
  const double length = std::clamp(long_m - 3.2, 1.4, 5.0);
  const double shift = -(long_m - length) / 2 + 0.9;
  const Pose T_room_table = along_x ? standing({shift, 0, 0}, 0) : standing({0, shift, 0}, 90);
  b.place(T_room_table);
  long_table(b, length);
  const int seats = std::max(2, static_cast<int>(length / 0.75));
  on_long_table(b, rig, length, seats, random);
  for (int i = 0; i < seats; ++i)
    for (const double y : {-0.72, 0.72}) {
      const double x = ((i + 0.5) / seats - 0.5) * (length - 0.1);
      b.place(T_room_table * standing({x, y + random.uniform(-0.06, 0.06), 0},
                                      (y < 0 ? 180 : 0) + random.uniform(-20, 20)));
      swivel_chair(b, 0x3E4F63);
    }
  b.place(at_wall(rig, along_x ? 1 : 0));
  if (along_x) wall_screen(b, "WELCOME\nAGENDA 9 TO 5");
  b.place(at_wall(rig, 2, -0.1 * rig.room_m.x));
  whiteboard(b, 0, "AGENDA\n1 SCAN\n2 MESH\n3 STREAM ^");
  b.place(at_wall(rig, 3));
  door(b, rig, 3, rig.room_m.y / 2 - 0.9);
  hang_picture(b, landscape(rig.seed * 7 + 1), 0x232323, -0.25 * rig.room_m.y, 1.55, 1.0, 0.65,
               0.04);
  b.place(standing({rig.room_m.x / 2 - 0.5, -rig.room_m.y / 2 + 0.5, 0}, 0), 0.9);
  plant(b, random);
  b.place({});
  bin(b, {-rig.room_m.x / 2 + 0.25, -rig.room_m.y / 2 + 0.25, 0});
}

void office(Builder& b, const RigConfig& rig, std::vector<Light>& lights) {
  Random random(rig.seed);
  const double w = rig.room_m.x / 2, d = rig.room_m.y / 2;
  six_sides(b, rig, bright_sides(0x6E6A63, 0x9DB0B8));
  for (int wall = 0; wall < 4; ++wall) skirting(b, rig, wall, wall % 2 ? -d : -w, wall % 2 ? d : w);
  panels_for(b, rig, lights);
  b.place(at_wall(rig, 0));
  window(b, rig, 0.1 * w, lights);
  desk_row(b, rig, 0, 0, random);
  desk_row(b, rig, 2, 3, random);
  b.place(at_wall(rig, 2));
  whiteboard(b, -0.3 * w, "TODAY\n1 FUSE\n2 MERGE\n3 TEST");
  notice_board(b, 0.45 * w, 1.5, 0.9, 0.7, random);
  b.place(at_wall(rig, 1, 0.25 * d));
  bookshelf(b, rig.detail, random);
  b.place(at_wall(rig, 1));
  hang_picture(b, lettered("MESHREDUCE", 0xF6F1E3, 0x1B2A49), 0x2A2A2A, 0.25 * d, 1.95, 1.4, 0.36,
               0.03);
  b.place(at_wall(rig, 3));
  door(b, rig, 3, 0.1 * d);
  hang_picture(b, landscape(rig.seed * 7 + 2), 0x5A3A22, -0.45 * d, 1.55, 0.7, 0.5, 0.04);
  b.place(standing({w - 0.5, d - 0.5, 0}, 0), 0.9);
  plant(b, random);
  b.place(standing({-w + 0.45, -d + 0.45, 0}, 0), 0.75);
  plant(b, random);
  b.place({});
  bin(b, {-w + 0.25, d - 0.3, 0});
  b.place(standing({w - 0.35, -d + 0.4, 0}, 8));
  if (rig.detail > 0.3) carton(b);
}

}  // namespace mr::synth
