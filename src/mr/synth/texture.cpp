#include "mr/synth/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

#include "mr/synth/hash.h"

namespace mr::synth {
namespace {

// --- letters

constexpr int kGlyphWidth = 5, kGlyphHeight = 7, kAdvance = 6, kLineHeight = 9;
using Glyph =
    std::array<std::uint8_t, kGlyphHeight>;  ///< rows from the top; bit 4 is the left column

constexpr std::array<Glyph, 26> kLetters{{
    {0x0E, 0x11, 0x11, 0x1F, 0x11, 0x11, 0x11}, {0x1E, 0x11, 0x11, 0x1E, 0x11, 0x11, 0x1E},
    {0x0E, 0x11, 0x10, 0x10, 0x10, 0x11, 0x0E}, {0x1E, 0x11, 0x11, 0x11, 0x11, 0x11, 0x1E},
    {0x1F, 0x10, 0x10, 0x1E, 0x10, 0x10, 0x1F}, {0x1F, 0x10, 0x10, 0x1E, 0x10, 0x10, 0x10},
    {0x0E, 0x11, 0x10, 0x17, 0x11, 0x11, 0x0F}, {0x11, 0x11, 0x11, 0x1F, 0x11, 0x11, 0x11},
    {0x0E, 0x04, 0x04, 0x04, 0x04, 0x04, 0x0E}, {0x07, 0x02, 0x02, 0x02, 0x02, 0x12, 0x0C},
    {0x11, 0x12, 0x14, 0x18, 0x14, 0x12, 0x11}, {0x10, 0x10, 0x10, 0x10, 0x10, 0x10, 0x1F},
    {0x11, 0x1B, 0x15, 0x15, 0x11, 0x11, 0x11}, {0x11, 0x19, 0x15, 0x13, 0x11, 0x11, 0x11},
    {0x0E, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0E}, {0x1E, 0x11, 0x11, 0x1E, 0x10, 0x10, 0x10},
    {0x0E, 0x11, 0x11, 0x11, 0x15, 0x12, 0x0D}, {0x1E, 0x11, 0x11, 0x1E, 0x14, 0x12, 0x11},
    {0x0F, 0x10, 0x10, 0x0E, 0x01, 0x01, 0x1E}, {0x1F, 0x04, 0x04, 0x04, 0x04, 0x04, 0x04},
    {0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0E}, {0x11, 0x11, 0x11, 0x11, 0x11, 0x0A, 0x04},
    {0x11, 0x11, 0x11, 0x15, 0x15, 0x1B, 0x11}, {0x11, 0x11, 0x0A, 0x04, 0x0A, 0x11, 0x11},
    {0x11, 0x11, 0x0A, 0x04, 0x04, 0x04, 0x04}, {0x1F, 0x01, 0x02, 0x04, 0x08, 0x10, 0x1F},
}};
constexpr std::array<Glyph, 10> kDigits{{
    {0x0E, 0x11, 0x13, 0x15, 0x19, 0x11, 0x0E},
    {0x04, 0x0C, 0x04, 0x04, 0x04, 0x04, 0x0E},
    {0x0E, 0x11, 0x01, 0x02, 0x04, 0x08, 0x1F},
    {0x1F, 0x02, 0x04, 0x02, 0x01, 0x11, 0x0E},
    {0x02, 0x06, 0x0A, 0x12, 0x1F, 0x02, 0x02},
    {0x1F, 0x10, 0x1E, 0x01, 0x01, 0x11, 0x0E},
    {0x06, 0x08, 0x10, 0x1E, 0x11, 0x11, 0x0E},
    {0x1F, 0x01, 0x02, 0x04, 0x08, 0x08, 0x08},
    {0x0E, 0x11, 0x11, 0x0E, 0x11, 0x11, 0x0E},
    {0x0E, 0x11, 0x11, 0x0F, 0x01, 0x02, 0x0C},
}};
constexpr Glyph kArrow{0x04, 0x0E, 0x1F, 0x04, 0x04, 0x04, 0x04};

bool glyph_covers(char letter, int column, int row) {
  if (column < 0 || column >= kGlyphWidth || row < 0 || row >= kGlyphHeight) return false;
  std::uint8_t bits = 0;
  if (letter >= 'A' && letter <= 'Z') bits = kLetters[letter - 'A'][row];
  if (letter >= '0' && letter <= '9') bits = kDigits[letter - '0'][row];
  if (letter == '^') bits = kArrow[row];
  return (bits >> (kGlyphWidth - 1 - column) & 1) != 0;
}

/// Is there ink at a place given in font pixels from the text block's top left corner?
bool text_covers(std::string_view text, int columns, float x, float y) {
  if (x < 0 || y < 0) return false;
  for (int line = static_cast<int>(y) / kLineHeight; line > 0; --line) {
    const auto end = text.find('\n');
    if (end == std::string_view::npos) return false;
    text.remove_prefix(end + 1);
  }
  text = text.substr(0, text.find('\n'));
  // Lines are centred, in whole pixels.
  const int column = static_cast<int>(std::floor(x)) -
                     (columns - (static_cast<int>(text.size()) * kAdvance - 1)) / 2;
  if (column < 0 || column / kAdvance >= static_cast<int>(text.size())) return false;
  return glyph_covers(text[column / kAdvance], column % kAdvance,
                      static_cast<int>(y) % kLineHeight);
}

// --- noise

/// Noise on the integer lattice, -1..1, smooth in between.
float value_noise(float x, float y, std::uint32_t seed) {
  const float fx = std::floor(x), fy = std::floor(y);
  const auto ix = static_cast<std::uint32_t>(static_cast<std::int32_t>(fx));
  const auto iy = static_cast<std::uint32_t>(static_cast<std::int32_t>(fy));
  const auto at = [&](std::uint32_t a, std::uint32_t b) {
    std::uint32_t h = a * 0x8DA6B343u ^ b * 0xD8163841u ^ seed * 0xCB1AB31Fu;
    h = (h ^ (h >> 16)) * 0x7FEB352Du;
    h = (h ^ (h >> 15)) * 0x846CA68Bu;
    return static_cast<float>((h ^ (h >> 16)) >> 8) * (2.0f / 16777216.0f) - 1.0f;
  };
  const auto ease = [](float t) { return t * t * (3 - 2 * t); };
  const float u = ease(x - fx), v = ease(y - fy);
  const float low = at(ix, iy) * (1 - u) + at(ix + 1, iy) * u;
  const float high = at(ix, iy + 1) * (1 - u) + at(ix + 1, iy + 1) * u;
  return low * (1 - v) + high * v;
}

float random_of(int a, int b, std::uint32_t seed) {
  return unit(mix(mix(static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b)), seed));
}

float fraction(float v) { return v - std::floor(v); }
Vec3f blend(Vec3f a, Vec3f b, float t) { return a * (1 - t) + b * t; }
float ramp(float v, float from, float to) {
  return std::clamp((v - from) / (to - from), 0.0f, 1.0f);
}

// --- patterns; uv in metres, st in 0..1

Vec3f planks(const Material& m, Vec2f uv) {
  constexpr float kWidth = 0.14f, kLength = 1.3f, kGap = 0.004f;
  const int row = static_cast<int>(std::floor(uv.y / kWidth));
  const float along = uv.x + kLength * random_of(row, 7, m.seed);
  const int board = static_cast<int>(std::floor(along / kLength));
  const float v = fraction(uv.y / kWidth) * kWidth, u = fraction(along / kLength) * kLength;
  if (v < kGap || u < kGap) return m.accent;
  return m.color * (0.72f + 0.5f * random_of(row, board, m.seed));
}

Vec3f wood(const Material& m, Vec2f uv, float grain) {
  const float ring = fraction(uv.y * 14 + grain * 2.5f + random_of(1, 2, m.seed));
  return blend(m.color, m.accent, 0.35f * std::abs(2 * ring - 1));
}

Vec3f rug(const Material& m, Vec2f uv) {
  const float edge = std::min({uv.x, uv.y, m.size_m.x - uv.x, m.size_m.y - uv.y});
  if (edge < 0.06f) return m.color * 0.6f;
  if (edge < 0.09f || (edge > 0.16f && edge < 0.175f)) return m.accent;
  if (edge < 0.16f) return m.color;
  const float a = fraction((uv.x + uv.y) / 0.4f), b = fraction((uv.x - uv.y) / 0.4f);
  const float diamond = std::max(std::abs(a - 0.5f), std::abs(b - 0.5f));
  if (diamond > 0.455f) return m.accent;
  return diamond < 0.14f ? blend(m.accent, m.color, 0.4f) : m.color;
}

Vec3f checker(const Material& m, Vec2f st) {
  constexpr int kColumns = 9, kRows = 6;
  const float x = st.x * (kColumns + 1) - 0.5f, y = st.y * (kRows + 1) - 0.5f;
  if (x < 0 || y < 0 || x >= kColumns || y >= kRows) return m.color;
  return (static_cast<int>(x) + static_cast<int>(y)) % 2 == 0 ? m.accent : m.color;
}

/// Is a place inked by a text that fills a box in the middle of the surface as well as it can?
bool text_inks(const Material& m, Vec2f uv, Vec2f box_m) {
  int columns = 0, rows = kGlyphHeight, line = 0;
  for (const char c : m.text) {
    line = c == '\n' ? 0 : line + kAdvance;
    rows += c == '\n' ? kLineHeight : 0;
    columns = std::max(columns, line - 1);
  }
  const float pixel = std::min(box_m.x / columns, box_m.y / rows);
  const float x = (uv.x - 0.5f * m.size_m.x) / pixel + 0.5f * columns;
  const float y = (0.5f * m.size_m.y - uv.y) / pixel + 0.5f * rows;
  return text_covers(m.text, columns, x, y);
}

/// The text as large as its lines allow, centred, with a thin frame.
Vec3f lettering(const Material& m, Vec2f uv) {
  const float edge = std::min({uv.x, uv.y, m.size_m.x - uv.x, m.size_m.y - uv.y});
  const float smaller = std::min(m.size_m.x, m.size_m.y);
  if (edge > 0.03f * smaller && edge < 0.055f * smaller) return m.accent;
  return text_inks(m, uv, {0.84f * m.size_m.x, 0.76f * m.size_m.y}) ? m.accent : m.color;
}

Vec3f book(const Material& m, Vec2f st) {
  const float band = random_of(3, 1, m.seed) * 0.12f;
  if (std::abs(st.y - 0.12f - band) < 0.015f || std::abs(st.y - 0.88f + band) < 0.015f)
    return m.accent;
  const bool title = std::abs(st.x - 0.5f) < 0.22f && std::abs(st.y - 0.52f) < 0.2f;
  const bool letter = random_of(static_cast<int>(st.y * 40), 5, m.seed) < 0.72f;
  return title && letter ? m.accent : m.color;
}

/// Sky, a sun, three rows of hills and a meadow.
Vec3f landscape(const Material& m, Vec2f st) {
  const float wide = st.x * m.size_m.x / m.size_m.y;
  const Vec3f sky = blend({0.85f, 0.86f, 0.82f}, {0.16f, 0.42f, 0.86f}, ramp(st.y, 0.45f, 1.0f));
  const float cloud = value_noise(wide * 4, st.y * 9, m.seed + 5) +
                      0.5f * value_noise(wide * 9, st.y * 20, m.seed + 6);
  Vec3f color = blend(sky, {0.95f, 0.95f, 0.95f}, ramp(cloud, 0.25f, 0.8f));
  const float dx = wide - 0.3f - 0.8f * random_of(1, 1, m.seed), dy = st.y - 0.8f;
  if (dx * dx + dy * dy < 0.006f) color = {1.0f, 0.86f, 0.35f};
  constexpr std::array<Vec3f, 3> kHills{
      {{0.22f, 0.33f, 0.45f}, {0.12f, 0.26f, 0.16f}, {0.20f, 0.36f, 0.07f}}};
  for (int i = 0; i < 3; ++i) {
    const float rough = value_noise(wide * 2.2f, 7.0f * i, m.seed + i) * 0.16f +
                        value_noise(wide * 11, 3.0f * i, m.seed + i) * 0.03f;
    if (st.y < 0.56f - 0.14f * i + rough) color = kHills[i] * (0.75f + 0.6f * st.y);
  }
  return color;
}

Vec3f leaf(const Material& m, Vec2f st) {
  const float across = std::abs(st.x - 0.5f);
  if (across < 0.035f) return m.accent;
  const float vein = fraction(st.y * 8 - across * 3);
  return vein < 0.13f ? blend(m.color, m.accent, 0.5f) : m.color;
}

// --- people

/// How much of a soft-edged ellipse around a centre covers a place, 0..1.
float spot(Vec2f at, Vec2f center, Vec2f radii, float softness) {
  const Vec2f d{(at.x - center.x) / radii.x, (at.y - center.y) / radii.y};
  return 1 - ramp(std::sqrt(d.x * d.x + d.y * d.y), 1 - softness, 1 + softness);
}

/// An eye of the right half of a face; `at` from the middle of the eyes, x outwards.
Vec3f eye(const Material& m, Vec3f skin, Vec2f at) {
  constexpr Vec2f kCenter{0.0325f, 0};
  const float bend = (at.x - kCenter.x) / 0.0135f;
  const float upper = 0.0062f * (1 - bend * bend), lower = -0.0048f * (1 - bend * bend);
  const float lid = 0.0016f;
  if (std::abs(bend) > 1.12f || at.y > upper + lid || at.y < lower - 0.0007f) return skin;
  if (std::abs(bend) > 1 || at.y > upper || at.y < lower) return skin * 0.22f;
  const float to_iris = std::hypot(at.x - kCenter.x, at.y - 0.0006f);
  const Vec3f white{0.55f, 0.53f, 0.50f};
  const float brown = m.color.x > 0.4f ? random_of(1, 9, m.seed) : 0.0f;
  const Vec3f iris = blend({0.10f, 0.045f, 0.02f}, {0.12f, 0.22f, 0.30f}, brown > 0.6f ? brown : 0);
  if (to_iris < 0.0024f) return {0.01f, 0.01f, 0.01f};
  return blend(iris, white, ramp(to_iris, 0.0052f, 0.0060f)) *
         (at.y > upper - 0.002f ? 0.7f : 1.0f);
}

/// Both halves of a face are alike.
Vec3f face(const Material& m, Vec2f uv, float grain) {
  const Vec2f at{std::abs(uv.x - 0.5f * m.size_m.x), uv.y - 0.5f * m.size_m.y};
  const Vec3f rosy{m.color.x * 0.92f, m.color.y * 0.62f, m.color.z * 0.58f};
  const Vec3f lips{m.color.x * 0.72f, m.color.y * 0.38f, m.color.z * 0.40f};
  Vec3f skin = blend(m.color, rosy, 0.35f * spot(at, {0.045f, -0.030f}, {0.026f, 0.020f}, 0.9f));
  skin = blend(skin, rosy, 0.35f * spot(at, {0, -0.032f}, {0.016f, 0.012f}, 0.8f));
  skin = skin * (1 - 0.15f * spot(at, {0.032f, 0.001f}, {0.022f, 0.013f}, 0.7f));
  skin = skin * (1 - 0.75f * spot(at, {0.0075f, -0.0385f}, {0.0042f, 0.0022f}, 0.5f));
  const float mouth_width = 0.024f, across = at.x / mouth_width;
  const float upper = -0.0665f + 0.0068f * (1 - across * across) - 0.002f * (at.x < 0.003f ? 1 : 0);
  const float lower = -0.0665f - 0.0095f * (1 - across * across);
  if (across < 1 && at.y < upper && at.y > lower)
    skin = std::abs(at.y + 0.0665f + 0.001f * across) < 0.0011f ? lips * 0.3f : lips;
  const float arch = 0.0205f + 0.0045f * std::sin(3.0f * ramp(at.x, 0.012f, 0.056f));
  const float brow = spot(at, {0.033f, arch}, {0.022f, 0.0040f}, 0.35f);
  skin = blend(skin, m.accent * 0.7f, 0.9f * brow * (0.8f + 0.5f * grain));
  return eye(m, skin, at);
}

Vec3f hair_strands(const Material& m, Vec2f uv) {
  const float bent = uv.x + 0.004f * value_noise(uv.x * 20, uv.y * 14, m.seed);
  const float strand = value_noise(bent * 900, uv.y * 9, m.seed + 1);
  const float lock = value_noise(bent * 160, uv.y * 11, m.seed + 2);
  const float light = 0.5f + 0.5f * value_noise(uv.x * 30, uv.y * 25, m.seed + 3);
  return blend(m.color * (0.75f + 0.35f * strand + 0.3f * lock), m.accent,
               0.10f * std::max(strand * light, 0.0f));
}

/// Brightness of stitches: columns of slanted loops.
float stitches(Vec2f uv) {
  constexpr float kWide = 0.0056f, kHigh = 0.0042f;
  const float column = fraction(uv.x / kWide), slant = std::abs(column - 0.5f);
  const float row = fraction(uv.y / kHigh + slant);
  return (0.80f + 0.26f * row) * (slant > 0.43f ? 0.80f : 1.0f);
}

Vec3f denim(const Material& m, Vec2f uv, float grain) {
  const float twill = fraction((uv.x + 0.6f * uv.y) / 0.0032f) < 0.5f ? 0.90f : 1.08f;
  const float thread = value_noise(uv.x * 700, uv.y * 120, m.seed);
  const float worn = ramp(0.6f * grain + value_noise(uv.x * 9, uv.y * 3, m.seed + 4), 0.2f, 1.3f);
  const float seam = std::abs(uv.x - 0.5f * m.size_m.x) < 0.0012f ? 0.65f : 1.0f;
  return blend(m.color, m.accent, 0.35f * worn) * (twill * seam * (1 + 0.10f * thread));
}

Vec3f plaid(const Material& m, Vec2f uv) {
  constexpr float kPeriod = 0.062f;
  const auto share = [](float at) {
    return at < 0.42f ? 1.0f : at > 0.68f && at < 0.74f ? 0.7f : 0.0f;
  };
  const float both = share(fraction(uv.x / kPeriod)) + share(fraction(uv.y / kPeriod));
  const float thread = fraction((uv.x - uv.y) / 0.0024f) < 0.5f ? 0.94f : 1.04f;
  return blend(m.accent, m.color, 0.12f + 0.44f * both) * thread;
}

Vec3f bands(const Material& m, Vec2f uv) {
  return (fraction(uv.y / 0.055f) < 0.36f ? m.accent : m.color) * stitches(uv);
}

Vec3f print(const Material& m, Vec2f uv) {
  constexpr Vec2f kBox{0.22f, 0.14f};
  return text_inks(m, uv, kBox) ? m.accent : m.color * stitches(uv);
}

Vec3f film(const Material& m, Vec2f st) {
  const auto wave = [](float turns) {
    return 0.5f + 0.5f * std::sin(2 * std::numbers::pi_v<float> * turns);
  };
  const float dx = st.x - 0.15f - 0.7f * wave(0.31f * m.phase),
              dy = st.y - 0.25f - 0.5f * wave(0.43f * m.phase);
  if (std::max(std::abs(dx), 0.6f * std::abs(dy)) < 0.09f) return {1, 0.95f, 0.8f};
  return {0.05f + 0.7f * wave(1.3f * st.x + m.phase),
          0.05f + 0.6f * wave(st.x + st.y - 0.8f * m.phase),
          0.1f + 0.7f * wave(1.7f * st.y + 0.6f * m.phase)};
}

}  // namespace

float grain_at(const Material& m, Vec2f surface) {
  constexpr int kOctaves = 6;
  constexpr float kLongest = 1 / 0.35f, kFall = 0.62f;
  float x = surface.x * m.grain_scale.x * kLongest, y = surface.y * m.grain_scale.y * kLongest;
  float sum = 0, weight = 0.75f;
  for (int i = 0; i < kOctaves; ++i, x *= 2, y *= 2, weight *= kFall)
    sum += weight * value_noise(x, y, m.seed + 31 * i);
  return sum;
}

Vec3f paint(const Material& m, Vec2f uv, float grain) {
  const Vec2f st{uv.x / m.size_m.x, uv.y / m.size_m.y};
  Vec3f color = m.color;
  switch (m.pattern) {
    case Pattern::plain:
      break;
    case Pattern::planks:
      color = planks(m, uv);
      break;
    case Pattern::wood:
      color = wood(m, uv, grain);
      break;
    case Pattern::rug:
      color = rug(m, uv);
      break;
    case Pattern::stripes:
      color = fraction(st.x * 6) < 0.5f ? m.color : m.accent;
      break;
    case Pattern::checker:
      color = checker(m, st);
      break;
    case Pattern::text:
      color = lettering(m, uv);
      break;
    case Pattern::book:
      color = book(m, st);
      break;
    case Pattern::picture:
      color = landscape(m, st);
      break;
    case Pattern::leaf:
      color = leaf(m, st);
      break;
    case Pattern::face:
      color = face(m, uv, grain);
      break;
    case Pattern::hair:
      color = hair_strands(m, uv);
      break;
    case Pattern::knit:
      color = m.color * stitches(uv);
      break;
    case Pattern::denim:
      color = denim(m, uv, grain);
      break;
    case Pattern::bands:
      color = bands(m, uv);
      break;
    case Pattern::plaid:
      color = plaid(m, uv);
      break;
    case Pattern::print:
      color = print(m, uv);
      break;
    case Pattern::film:
      color = film(m, st);
      break;
  }
  const float shade = 1 + m.grain * grain;
  return max(color * std::max(shade, 0.0f), Vec3f{});
}

Vec3f linear_color(std::uint32_t srgb) {
  const auto channel = [&](int shift) {
    const double v = (srgb >> shift & 0xFF) / 255.0;
    return static_cast<float>(v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
  };
  return {channel(16), channel(8), channel(0)};
}

}  // namespace mr::synth
