#include "mr/synth/pieces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace mr::synth {
namespace {

constexpr std::array<std::uint32_t, kBrightColors> kBright{0xB23A2E, 0x27517F, 0xE0A52E, 0x3F7A4B,
                                                           0x7A3E6E, 0xD9D2BF, 0x2F2F38, 0xD9703A,
                                                           0x4E93A8, 0x8A9A3B};

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

}  // namespace

std::uint32_t bright_color(int i) { return kBright[i % kBrightColors]; }

Material plain(std::uint32_t srgb, float grain) {
  Material m;
  m.color = linear_color(srgb);
  m.grain = grain;
  return m;
}

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

// --- along the walls; frame: x right, y into the wall

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

// --- on the floor

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
  b.fill({-0.4, -0.4, 0.4}, {0.4, 0.4, 1.1});
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

void tube(Builder& b, std::span<const Vec3d> points, double radius, MaterialId material) {
  constexpr int kCorners = 8;
  const int rows = static_cast<int>(points.size()) - 1;
  double long_m = 0;
  for (int i = 0; i < rows; ++i) long_m += length(points[i + 1] - points[i]);
  const Vec2d size{2 * std::numbers::pi * radius, long_m};
  b.sheet(kCorners, rows, size, b.sized(material, size.x, size.y), [&](double u, double v) {
    const double at = std::clamp(v, 0.0, 1.0) * rows;
    const int k = std::min(static_cast<int>(at), rows - 1);
    const Vec3d way = normalized(points[k + 1] - points[k]);
    const Vec3d helper = std::abs(way.z) < 0.9 ? Vec3d{0, 0, 1} : Vec3d{1, 0, 0};
    const Vec3d x = normalized(cross(helper, way)), y = cross(way, x);
    const double a = 2 * std::numbers::pi * u;
    return points[k] + (points[k + 1] - points[k]) * (at - k) +
           (x * std::cos(a) + y * std::sin(a)) * radius;
  });
}

void swivel_chair(Builder& b, std::uint32_t seat_color) {
  const MaterialId dark = b.add(plain(0x3A3A40, 0.05f));
  const std::array<Vec2d, 2> post{{{0.025, 0.07}, {0.025, 0.43}}};
  b.lathe({0, 0, 0}, post, 12, dark);
  for (int i = 0; i < 5; ++i) {
    const double a = i * 2 * std::numbers::pi / 5 + 0.3, x = std::cos(a), y = std::sin(a);
    const std::array<Vec3d, 3> foot{
        {{0.02 * x, 0.02 * y, 0.09}, {0.15 * x, 0.15 * y, 0.075}, {0.29 * x, 0.29 * y, 0.055}}};
    tube(b, foot, 0.016, dark);
    b.sphere({0.29 * x, 0.29 * y, 0.028}, 0.028, dark);
  }
  cushion(b, {0, 0, 0.46}, {0.24, 0.23, 0.045}, 0, seat_color);
  b.box({-0.03, 0.2, 0.44}, {0.03, 0.225, 0.66}, dark);
  cushion(b, {0, 0.23, 0.74}, {0.22, 0.04, 0.26}, -0.08, seat_color);
  b.fill({-0.25, -0.25, 0.4}, {0.25, 0.28, 1.0});
}

void monitor(Builder& b, Vec3d foot, const std::string& text) {
  const MaterialId dark = b.add(plain(0x2E2E33, 0.05f));
  b.box(foot + Vec3d{-0.11, -0.08, 0}, foot + Vec3d{0.11, 0.08, 0.012}, dark);
  b.box(foot + Vec3d{-0.025, 0.0, 0.012}, foot + Vec3d{0.025, 0.03, 0.2}, dark);
  b.box(foot + Vec3d{-0.28, -0.02, 0.12}, foot + Vec3d{0.28, 0.012, 0.47}, dark);
  Material screen = lettered(text, 0x1F3B6B, 0xE8F0FF);
  screen.size_m = {0.53f, 0.32f};
  screen.emission = 0.7f;
  b.panel(foot + Vec3d{-0.265, -0.022, 0.135}, {0.53, 0, 0}, {0, 0, 0.32}, b.add(screen));
}

void desk_lamp(Builder& b, Vec3d foot) {
  const MaterialId metal = b.add(plain(0xB5442E, 0.08f));
  const std::array<Vec2d, 3> base{{{0.08, 0.0}, {0.08, 0.015}, {0.01, 0.02}}};
  b.lathe(foot, base, 20, metal);
  const std::array<Vec3d, 2> lower{{foot + Vec3d{0, 0, 0.015}, foot + Vec3d{0.09, 0.02, 0.3}}};
  const std::array<Vec3d, 2> upper{
      {foot + Vec3d{0.09, 0.02, 0.3}, foot + Vec3d{-0.14, -0.08, 0.47}}};
  tube(b, lower, 0.006, metal);
  tube(b, upper, 0.006, metal);
  const std::array<Vec2d, 3> shade{{{0.07, 0.0}, {0.05, 0.06}, {0.015, 0.1}}};
  b.lathe(foot + Vec3d{-0.14, -0.08, 0.39}, shade, 24, metal);
}

void paper(Builder& b, Vec3d middle, double turn_degrees, Random& random) {
  constexpr const char* kPages[] = {"REPORT\nPAGE 1", "BUDGET\n10 20 30", "PLAN B",
                                    "TO DO\n1 TEST\n2 SHIP"};
  Material page = lettered(kPages[random.index(4)], 0xF4F2EA, 0x24242C);
  page.size_m = {0.21f, 0.297f};
  const double a = turn_degrees * std::numbers::pi / 180;
  const Vec3d right{std::cos(a), std::sin(a), 0}, up{-std::sin(a), std::cos(a), 0};
  b.panel(middle - right * 0.105 - up * 0.1485 + Vec3d{0, 0, 0.002}, right * 0.21, up * 0.297,
          b.add(page));
}

void bin(Builder& b, Vec3d foot) {
  const std::array<Vec2d, 5> wall{
      {{0.11, 0.0}, {0.15, 0.3}, {0.145, 0.3}, {0.105, 0.01}, {0.001, 0.01}}};
  b.lathe(foot, wall, 24, b.add(plain(0x5A6068, 0.1f)));
}

void bench(Builder& b, double width) {
  const MaterialId top = b.add(timber(0xB5854F, 0x7A4F2A, false));
  const MaterialId leg = b.add(plain(0x3A3D42, 0.08f));
  for (int i = 0; i < 4; ++i) {
    const double y = -0.45 + i * 0.105;
    b.box({-width / 2, y, 0.42}, {width / 2, y + 0.085, 0.455}, top);
  }
  for (const double x : {-width / 2 + 0.1, width / 2 - 0.15}) {
    b.box({x, -0.44, 0}, {x + 0.05, -0.4, 0.42}, leg);
    b.box({x, -0.09, 0}, {x + 0.05, -0.05, 0.42}, leg);
    b.box({x, -0.4, 0.37}, {x + 0.05, -0.09, 0.42}, leg);
  }
}

void radiator(Builder& b, double width) {
  const MaterialId white = b.add(plain(0xECE9E1, 0.05f));
  const int ribs = static_cast<int>(width / 0.06);
  for (int i = 0; i < ribs; ++i) {
    const double x = -width / 2 + (i + 0.5) * width / ribs;
    b.box({x - 0.02, -0.1, 0.16}, {x + 0.02, -0.03, 0.74}, white);
  }
  for (const double z : {0.2, 0.68})
    b.box({-width / 2, -0.08, z}, {width / 2, -0.05, z + 0.03}, white);
  const std::array<Vec3d, 3> pipe{{{width / 2, -0.065, 0.215},
                                   {width / 2 + 0.08, -0.065, 0.215},
                                   {width / 2 + 0.08, -0.065, 0.0}}};
  tube(b, pipe, 0.011, white);
}

}  // namespace mr::synth
