#include "mr/synth/furniture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "mr/synth/hash.h"

namespace mr::synth {
namespace {

constexpr std::array<std::uint32_t, 10> kBright{0xB23A2E, 0x27517F, 0xE0A52E, 0x3F7A4B, 0x7A3E6E,
                                                0xD9D2BF, 0x2F2F38, 0xD9703A, 0x4E93A8, 0x8A9A3B};

Material plain(std::uint32_t srgb, float grain = 0.15f) {
  Material m;
  m.color = linear_color(srgb);
  m.grain = grain;
  return m;
}

/// Wood with its grain upright (on sides) or along x (on tops).
Material timber(std::uint32_t light, std::uint32_t dark, bool upright) {
  Material m = plain(light, 0.3f);
  m.accent = linear_color(dark);
  m.pattern = upright ? Pattern::plain : Pattern::wood;
  m.grain_scale = upright ? Vec2f{9, 0.8f} : Vec2f{0.8f, 9};
  return m;
}

Material cloth(std::uint32_t srgb) {
  Material m = plain(srgb, 0.3f);
  m.grain_scale = {3, 3};
  return m;
}

// --- table and chairs

void table(Builder& b) {
  const MaterialId top = b.add(timber(0xA9713F, 0x6B4222, false));
  const MaterialId leg = b.add(timber(0x8E5C33, 0x5A381E, true));
  b.box({-0.85, -0.45, 0.71}, {0.85, 0.45, 0.74}, leg, top);
  for (const double x : {-0.79, 0.73})
    for (const double y : {-0.39, 0.33}) b.box({x, y, 0}, {x + 0.06, y + 0.06, 0.71}, leg);
  b.box({-0.73, -0.37, 0.63}, {0.73, -0.35, 0.71}, leg);
  b.box({-0.73, 0.35, 0.63}, {0.73, 0.37, 0.71}, leg);
}

/// Faces -y, towards someone sitting down on it.
void chair(Builder& b, std::uint32_t seat_color) {
  const MaterialId frame = b.add(timber(0x5C3B22, 0x3A2413, true)), seat = b.add(cloth(seat_color));
  for (const double x : {-0.2, 0.165}) {
    b.box({x, -0.2, 0}, {x + 0.035, -0.165, 0.44}, frame);
    b.box({x, 0.165, 0}, {x + 0.035, 0.2, 0.92}, frame);
  }
  b.box({-0.22, -0.22, 0.43}, {0.22, 0.2, 0.475}, seat);
  for (const double z : {0.58, 0.7, 0.82})
    b.box({-0.165, 0.172, z}, {0.165, 0.192, z + 0.07}, frame);
}

/// A cup turned from a profile, open at the top.
void cup(Builder& b, Vec3d foot, double radius, double height, std::uint32_t color) {
  const double r = radius, inner = radius - 0.005;
  const std::array<Vec2d, 6> profile{{{0.001, 0.002},
                                      {r * 0.8, 0.002},
                                      {r, height * 0.4},
                                      {r, height},
                                      {inner, height},
                                      {inner * 0.8, height * 0.3}}};
  b.lathe(foot, profile, 24, b.add(plain(color, 0.05f)));
}

void books_lying(Builder& b, Vec3d place, int count, Random& random) {
  for (int i = 0; i < count; ++i) {
    const double w = random.uniform(0.2, 0.26), d = random.uniform(0.14, 0.18);
    const double h = random.uniform(0.02, 0.04), shift = random.uniform(-0.02, 0.02);
    const MaterialId cover = b.add(plain(kBright[random.index(10)]));
    b.box(place + Vec3d{shift - w / 2, shift - d / 2, 0},
          place + Vec3d{shift + w / 2, shift + d / 2, h}, cover);
    place.z += h;
  }
}

void fruit_bowl(Builder& b, Vec3d foot) {
  const std::array<Vec2d, 6> bowl{
      {{0.05, 0.002}, {0.06, 0.012}, {0.13, 0.05}, {0.16, 0.085}, {0.152, 0.085}, {0.03, 0.025}}};
  b.lathe(foot, bowl, 32, b.add(plain(0x2E6E8E, 0.1f)));
  const std::array<std::uint32_t, 4> colors{0xE58A1F, 0xC8352B, 0x9FB83A, 0xE58A1F};
  for (int i = 0; i < 4; ++i) {
    const double a = i * std::numbers::pi / 2 + 0.4;
    b.sphere(foot + Vec3d{0.062 * std::cos(a), 0.062 * std::sin(a), 0.085}, 0.04,
             b.add(plain(colors[i], 0.1f)));
  }
}

void laptop(Builder& b, Vec3d place) {
  const MaterialId shell = b.add(plain(0x9A9DA3, 0.05f));
  Material screen = plain(0x1F3B6B, 0.0f);
  screen.pattern = Pattern::text;
  screen.text = "HELLO\nWORLD";
  screen.accent = linear_color(0xE8F0FF);
  screen.size_m = {0.32f, 0.21f};
  screen.emission = 0.8f;
  b.box(place + Vec3d{-0.17, -0.12, 0}, place + Vec3d{0.17, 0.12, 0.018}, shell);
  b.box(place + Vec3d{-0.17, 0.115, 0.018}, place + Vec3d{0.17, 0.127, 0.25}, shell);
  b.panel(place + Vec3d{-0.16, 0.113, 0.03}, {0.32, 0, 0}, {0, 0, 0.21}, b.add(screen));
}

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

// --- along the walls; frame: x right, y into the wall

void book_row(Builder& b, double left, double right, double z, double tallest, Random& random) {
  for (double x = left; x < right - 0.05;) {
    if (random.uniform(0, 1) < 0.08) x += random.uniform(0.04, 0.12);
    const double width = random.uniform(0.018, 0.05), height = tallest * random.uniform(0.7, 0.97);
    if (x + width > right) break;
    Material spine = plain(kBright[random.index(10)]);
    spine.pattern = Pattern::book;
    spine.accent = linear_color(kBright[random.index(10)]);
    spine.size_m = {static_cast<float>(width), static_cast<float>(height)};
    const double front = -0.27 + random.uniform(0, 0.03);
    b.box({x, front, z}, {x + width, -0.05, z + height}, b.add(spine), b.add(plain(0xE8E0CC)));
    x += width + 0.001;
  }
}

void bookshelf(Builder& b, double detail, Random& random) {
  const MaterialId side = b.add(timber(0xC99A62, 0x8E6236, true));
  const MaterialId flat = b.add(timber(0xC99A62, 0x8E6236, false));
  const double w = 0.75, h = 1.36;
  for (const double x : {-w, -0.0125, w - 0.025}) b.box({x, -0.3, 0}, {x + 0.025, -0.01, h}, side);
  b.box({-w, -0.02, 0}, {w, -0.005, h}, side);
  const int rows = 4;
  for (int i = 0; i <= rows; ++i) {
    const double z = 0.05 + i * (h - 0.075) / rows;
    b.box({-w, -0.3, z}, {w, -0.01, z + 0.025}, flat);
    if (i == rows) break;
    const double filled = 0.25 + 0.75 * std::min(1.0, 0.35 + detail);
    for (const double x : {-w + 0.03, 0.02})
      book_row(b, x, x + 0.69 * (random.uniform(0, 0.2) + 0.8) * filled, z + 0.025, 0.27, random);
  }
  cup(b, {-0.5, -0.15, h}, 0.07, 0.2, 0x2E5E8C);
  b.sphere({0.45, -0.16, h + 0.1}, 0.1, b.add(plain(0x5E8FB0, 0.6f)));  // a globe
  if (detail > 0.3) books_lying(b, {0.05, -0.16, h}, 3, random);
}

/// A cushion: a box with round sides, as a closed sheet.
void cushion(Builder& b, Vec3d center, Vec3d half, double lean, std::uint32_t color) {
  const MaterialId fabric = b.add(cloth(color));
  const auto soft = [](double c) { return std::copysign(std::pow(std::abs(c), 0.45), c); };
  const Vec2d size{4 * half.x, 2 * half.z};
  b.sheet(40, 20, size, b.sized(fabric, size.x, size.y), [&](double u, double v) {
    const double a = 2 * std::numbers::pi * u,
                 e = std::numbers::pi * (std::clamp(v, 0.0, 1.0) - 0.5);
    const double ring = soft(std::cos(e));
    const Vec3d p{half.x * ring * soft(std::cos(a)), half.y * ring * std::sin(a),
                  half.z * soft(std::sin(e))};
    return center + Vec3d{p.x, p.y + lean * p.z, p.z};
  });
}

void sofa(Builder& b) {
  const MaterialId body = b.add(cloth(0x4A5F73)), foot = b.add(plain(0x2A1D14));
  b.box({-1.0, -0.85, 0.08}, {1.0, -0.02, 0.28}, body);
  b.box({-1.0, -0.85, 0.28}, {-0.8, -0.02, 0.6}, body);
  b.box({0.8, -0.85, 0.28}, {1.0, -0.02, 0.6}, body);
  b.box({-0.8, -0.24, 0.28}, {0.8, -0.02, 0.82}, body);
  for (const double x : {-0.4, 0.4}) {
    cushion(b, {x, -0.55, 0.36}, {0.4, 0.31, 0.085}, 0, 0x56708A);
    cushion(b, {x, -0.31, 0.63}, {0.39, 0.09, 0.21}, 0.15, 0x56708A);
  }
  cushion(b, {-0.58, -0.48, 0.6}, {0.2, 0.07, 0.18}, 0.35, 0xD9A441);
  cushion(b, {0.6, -0.46, 0.6}, {0.2, 0.07, 0.18}, 0.3, 0xB5533C);
  for (const double x : {-0.95, 0.9})
    for (const double y : {-0.8, -0.12}) b.box({x, y, 0}, {x + 0.05, y + 0.05, 0.08}, foot);
}

void sideboard(Builder& b) {
  const MaterialId body = b.add(timber(0x7B4F2C, 0x4A2D17, true));
  const MaterialId top = b.add(timber(0x8B5B34, 0x553419, false));
  const MaterialId front = b.add(plain(0xE9E3D5, 0.12f)), knob = b.add(plain(0xB8923F, 0.05f));
  b.box({-0.8, -0.42, 0.12}, {0.8, -0.01, 0.8}, body);
  b.box({-0.83, -0.44, 0.8}, {0.83, 0, 0.83}, body, top);
  for (int i = 0; i < 4; ++i) {
    const double x = -0.77 + i * 0.39;
    b.box({x, -0.435, 0.16}, {x + 0.37, -0.415, 0.76}, front);
    b.sphere({x + (i % 2 == 0 ? 0.33 : 0.04), -0.45, 0.5}, 0.014, knob);
  }
  for (const double x : {-0.76, 0.71})
    for (const double y : {-0.4, -0.08}) b.box({x, y, 0}, {x + 0.05, y + 0.05, 0.12}, body);
}

// --- lamps

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

// --- on the floor

/// An arching leaf that starts at the pot's middle: `turn` about z, `reach` outwards, `rise` up.
void leaf(Builder& b, Vec3d foot, double turn, double reach, double rise, double width,
          MaterialId green) {
  const Vec3d out{std::cos(turn), std::sin(turn), 0}, side{std::sin(turn), -std::cos(turn), 0};
  const double long_m = std::hypot(reach, rise) * 1.2;
  const MaterialId sized = b.sized(green, width, long_m);
  b.sheet(6, 18, {width, long_m}, sized, [&](double u, double v) {
    const double s = std::clamp(v, 0.0, 1.0), across = u - 0.5;
    const double wide = width * std::pow(std::sin(std::numbers::pi * (0.06 + 0.93 * s)), 0.8);
    const double up = rise * (1.9 * s - 1.15 * s * s) / 0.75;
    const double fold = 0.35 * wide * std::abs(across);
    return foot + out * (0.02 + reach * s * s * 0.75 + reach * s * 0.25) + side * (across * wide) +
           Vec3d{0, 0, up + fold};
  });
}

void plant(Builder& b, Random& random) {
  const std::array<Vec2d, 6> pot{
      {{0.001, 0.002}, {0.13, 0.002}, {0.18, 0.32}, {0.195, 0.34}, {0.165, 0.335}, {0.002, 0.3}}};
  b.lathe({0, 0, 0}, pot, 32, b.add(plain(0xB5643C, 0.25f)));
  Material green = plain(0x3E7A35, 0.25f);
  green.pattern = Pattern::leaf;
  green.accent = linear_color(0x8DB85A);
  const MaterialId light = b.add(green);
  green.color = linear_color(0x2C5C2C);
  const MaterialId dark = b.add(green);
  constexpr int kLeaves = 15;
  for (int i = 0; i < kLeaves; ++i) {
    const double turn = i * 2.39996, inner = static_cast<double>(i) / kLeaves;
    leaf(b, {0, 0, 0.3}, turn, random.uniform(0.3, 0.42) * (1.1 - 0.6 * inner),
         random.uniform(0.35, 0.5) * (0.7 + 0.75 * inner), random.uniform(0.1, 0.14),
         i % 2 == 0 ? light : dark);
  }
}

void carton(Builder& b) {
  Material side = plain(0xB98B57, 0.2f);
  side.pattern = Pattern::text;
  side.text = "^ ^\nTHIS WAY UP";
  side.accent = linear_color(0x3B2512);
  side.size_m = {0.5f, 0.4f};
  Material top = plain(0xBF925E, 0.2f);
  b.box({-0.25, -0.25, 0}, {0.25, 0.25, 0.4}, b.add(side), b.add(top));
}

void toys(Builder& b, Vec3d middle, int count, double scale, Random& random) {
  for (int i = 0; i < count; ++i) {
    const double a = random.uniform(0, 6.28), r = random.uniform(0.1, 0.5);
    const double half = random.uniform(0.03, 0.055);
    b.place(standing(middle + Vec3d{r * std::cos(a), r * std::sin(a), 0}, random.uniform(0, 90)),
            scale);
    b.box({-half, -half, 0}, {half, half, 2 * half}, b.add(plain(kBright[(7 * i + 2) % 10], 0.1f)));
  }
}

void ball(Builder& b, Vec3d place, double radius, std::uint32_t color, std::uint32_t other) {
  Material striped = plain(color, 0.08f);
  striped.pattern = Pattern::stripes;
  striped.accent = linear_color(other);
  b.sphere(place + Vec3d{0, 0, radius}, radius, b.add(striped));
}

}  // namespace

double furniture_scale(const RigConfig& rig) {
  const double s = std::min({rig.room_m.x / 6.0, rig.room_m.y / 5.0, rig.room_m.z / 2.6});
  return std::clamp(s, 0.4, 1.0);
}

void furnish(Builder& b, const RigConfig& rig, std::vector<Light>& lights) {
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

}  // namespace mr::synth
