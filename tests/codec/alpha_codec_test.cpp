#include "mr/codec/alpha_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <string>

#include "mr/core/file.h"

namespace mr::codec {
namespace {

using Bytes = std::vector<std::byte>;

template <typename Inside>
ImageMask plane_of(int width, int height, const Inside& inside) {
  ImageMask out(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) *out.at(x, y) = inside(x, y) ? 1 : 0;
  return out;
}

ImageMask all(int width, int height, bool value) {
  return plane_of(width, height, [&](int, int) { return value; });
}

ImageMask noise(int width, int height, double density, unsigned seed) {
  std::mt19937 random(seed);
  return plane_of(width, height, [&](int, int) { return random() < density * 4294967296.0; });
}

/// In whole numbers, so that it is the same everywhere.
ImageMask disc(int width, int height) {
  const int diameter = std::min(width, height) * 4 / 5;
  return plane_of(width, height, [&](int x, int y) {
    const int dx = 2 * x + 1 - width, dy = 2 * y + 1 - height;
    return dx * dx + dy * dy < diameter * diameter;
  });
}

/// Heads and bodies, whose outlines tremble by a pixel or two.
ImageMask two_people(int width, int height) {
  const auto person = [&](double at, double x, double y) {
    const double u = (x / width - at) * 8 + 0.02 * std::sin(70 * y / height), v = y / height;
    const bool head = std::hypot(u, (v - 0.25) * 6) < 0.5;
    const bool body = v > 0.33 && v < 0.95 && std::abs(u) < 0.75 - 0.4 * std::abs(v - 0.5);
    return head || body;
  };
  return plane_of(width, height,
                  [&](int x, int y) { return person(0.3, x, y) || person(0.65, x, y); });
}

Bytes random_bytes(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  Bytes out(count);
  for (std::byte& byte : out) byte = static_cast<std::byte>(random());
  return out;
}

testing::AssertionResult comes_back(const ImageMask& plane) {
  const Bytes bytes = encode_alpha(plane);
  const auto back = decode_alpha(bytes, plane.width, plane.height);
  if (!back) return testing::AssertionFailure() << back.error().message;
  if (*back != plane) return testing::AssertionFailure() << "another plane";
  if (encode_alpha(plane) != bytes) return testing::AssertionFailure() << "other bytes";
  return testing::AssertionSuccess();
}

TEST(AlphaCodec, EveryPlaneComesBack) {
  constexpr int kSizes[][2] = {{1, 1},  {1, 2},   {2, 1},   {7, 9},   {8, 8},   {9, 8},
                               {8, 9},  {17, 5},  {1, 50},  {70, 1},  {15, 16}, {24, 24},
                               {33, 7}, {64, 48}, {63, 49}, {70, 50}, {3, 3}};
  for (const auto& [width, height] : kSizes) {
    SCOPED_TRACE(std::to_string(width) + "x" + std::to_string(height));
    for (const bool value : {false, true}) EXPECT_TRUE(comes_back(all(width, height, value)));
    for (const double density : {0.01, 0.1, 0.5, 0.9, 0.99})
      for (unsigned seed = 1; seed <= 5; ++seed)
        EXPECT_TRUE(comes_back(noise(width, height, density, seed))) << density << ", " << seed;
    EXPECT_TRUE(comes_back(disc(width, height)));
    EXPECT_TRUE(comes_back(plane_of(width, height, [](int x, int y) { return (x + y) % 2; })));
    EXPECT_TRUE(comes_back(plane_of(width, height, [](int x, int) { return x % 3 == 0; })));
  }
}

TEST(AlphaCodec, OutlinesOfPeopleAreFewBytes) {
  const ImageMask people = two_people(640, 360);
  ASSERT_TRUE(comes_back(people));
  EXPECT_LT(encode_alpha(people).size(), 400u);
  const ImageMask nothing = all(640, 360, false), everything = all(640, 360, true);
  ASSERT_TRUE(comes_back(nothing));
  ASSERT_TRUE(comes_back(everything));
  EXPECT_EQ(encode_alpha(nothing).size(), 1u);
  EXPECT_LT(encode_alpha(everything).size(), 24u) << "a hundredth of a bit for each of two symbols";
}

TEST(AlphaCodec, NoBytesAreAPlane) {
  EXPECT_TRUE(decode_alpha({}, 1, 1));
  EXPECT_TRUE(decode_alpha({}, 70, 50));
  EXPECT_EQ(*decode_alpha({}, 70, 50), *decode_alpha(Bytes(4), 70, 50)) << "as zeros";
}

TEST(AlphaCodec, MoreBytesThanItHasUseForAreRefused) {
  const ImageMask plane = two_people(64, 36);
  Bytes bytes = encode_alpha(plane);
  // What is left out at the end are zeros: so many may be there.
  int zeros = 0;
  for (; zeros < 8; ++zeros) {
    bytes.push_back(std::byte{0});
    const auto back = decode_alpha(bytes, 64, 36);
    if (!back) {
      EXPECT_EQ(back.error().cause, Error::Cause::invalid);
      break;
    }
    EXPECT_EQ(*back, plane);
  }
  EXPECT_LT(zeros, 8);
  EXPECT_FALSE(decode_alpha(Bytes(1000), 8, 8));
}

TEST(AlphaCodec, WhateverBytesThereAreTheyAreAPlane) {
  int refused = 0;
  for (unsigned seed = 0; seed < 2000; ++seed) {
    const int width = 1 + static_cast<int>(seed * 7 % 90), height = 1 + static_cast<int>(seed % 60);
    const auto plane = decode_alpha(random_bytes(seed % 300, seed), width, height);
    if (!plane) {
      EXPECT_EQ(plane.error().cause, Error::Cause::invalid);
      ++refused;
      continue;
    }
    for (const std::uint8_t pixel : plane->data) ASSERT_LE(pixel, 1);
    EXPECT_TRUE(comes_back(*plane)) << seed;
  }
  EXPECT_GT(refused, 50);
  EXPECT_LT(refused, 1500);
}

TEST(AlphaCodec, ATruncatedPlaneIsAnother) {
  const ImageMask plane = two_people(160, 90);
  const Bytes bytes = encode_alpha(plane);
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    const auto other = decode_alpha(std::span(bytes).first(n), 160, 90);
    ASSERT_TRUE(other) << n;
    EXPECT_NE(*other, plane) << n;
  }
}

void put(Bytes& out, std::size_t number) {
  for (int i = 0; i < 4; ++i) out.push_back(static_cast<std::byte>(number >> (8 * i) & 0xFF));
}

/// Width, height, number of coded bytes (32 bits each), these, and the pixels, eight a byte, the
/// first in the lowest bit.
void put(Bytes& out, const Bytes& coded, const ImageMask& plane) {
  for (const int side : {plane.width, plane.height}) put(out, static_cast<std::size_t>(side));
  put(out, coded.size());
  out.insert(out.end(), coded.begin(), coded.end());
  Bytes bits((plane.data.size() + 7) / 8);
  for (std::size_t i = 0; i < plane.data.size(); ++i)
    bits[i / 8] |= static_cast<std::byte>(plane.data[i] << (i % 8));
  out.insert(out.end(), bits.begin(), bits.end());
}

/// The page's decoder reads them, too: web/tests/unit/alpha.test.ts.
TEST(AlphaCodec, GoldenBytes) {
  Bytes out;
  constexpr int kSizes[][2] = {{1, 1}, {7, 9}, {8, 8}, {17, 5}, {64, 48}, {70, 50}};
  for (const auto& [width, height] : kSizes)
    for (const ImageMask& plane :
         {all(width, height, false), all(width, height, true), disc(width, height),
          noise(width, height, 0.5, 1), noise(width, height, 0.05, 2),
          plane_of(width, height, [](int x, int y) { return (x + y) % 2; })})
      put(out, encode_alpha(plane), plane);
  put(out, encode_alpha(disc(320, 180)), disc(320, 180));
  for (unsigned seed = 0; seed < 12; ++seed) {
    const Bytes any = random_bytes(10 * seed, seed);
    put(out, any, *decode_alpha(any, 60, 44));
  }
  const auto file = std::filesystem::path(MR_SOURCE_DIR) / "web/tests/data/alpha_planes.bin";
  if (std::getenv("MR_UPDATE_GOLDEN") != nullptr) {
    ASSERT_TRUE(write_file(file, out));
  }
  const auto golden = read_file(file);
  ASSERT_TRUE(golden) << golden.error().message;
  EXPECT_EQ(out, *golden) << "a change of format; see docs/wire-format.md";
}

}  // namespace
}  // namespace mr::codec
