#include "mr/kit/raw_color.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace mr::kit {
namespace {

using Rgb8 = std::array<std::uint8_t, 3>;

std::vector<std::byte> bytes_of(const std::vector<int>& values) {
  std::vector<std::byte> out;
  for (const int v : values) out.push_back(static_cast<std::byte>(v));
  return out;
}

Rgb8 pixel(const ImageRgb& image, int x, int y) {
  return {image.at(x, y)[0], image.at(x, y)[1], image.at(x, y)[2]};
}

/// ITU-R BT.601 as it is written, in floating point.
Rgb8 by_the_book(int y, int cb, int cr) {
  const double luma = (y - 16) / 219.0, b = (cb - 128) / 224.0, r = (cr - 128) / 224.0;
  const double red = luma + 1.402 * r, blue = luma + 1.772 * b;
  const double green = (luma - 0.299 * red - 0.114 * blue) / 0.587;
  const auto level = [](double v) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(v, 0.0, 1.0) * 255));
  };
  return {level(red), level(green), level(blue)};
}

TEST(RawColor, ColourBarsOfBt601HaveTheirColours) {
  // 75 % bars as BT.601 lists them: white, yellow, cyan, green, magenta, red, blue, black.
  constexpr int kBars[8][3] = {{180, 128, 128}, {162, 44, 142}, {131, 156, 44}, {112, 72, 58},
                               {84, 184, 198},  {65, 100, 212}, {35, 212, 114}, {16, 128, 128}};
  constexpr int kRgb[8][3] = {{191, 191, 191}, {191, 191, 0}, {0, 191, 191}, {0, 191, 0},
                              {191, 0, 191},   {191, 0, 0},   {0, 0, 191},   {0, 0, 0}};
  std::vector<int> yuy2;
  for (const auto& bar : kBars) yuy2.insert(yuy2.end(), {bar[0], bar[1], bar[0], bar[2]});
  const auto image = decode_raw_color(bytes_of(yuy2), {RawColorFormat::yuy2, 16, 1});
  ASSERT_TRUE(image) << image.error().message;
  for (int bar = 0; bar < 8; ++bar)
    for (int x = 2 * bar; x < 2 * bar + 2; ++x)
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(image->at(x, 0)[c], kRgb[bar][c], 2) << bar;
}

TEST(RawColor, EveryColourIsRoundedToTheNearestLevel) {
  // All of Y beside all of Cb, for some of Cr; also values outside of the limited range.
  for (const int cr : {0, 16, 90, 128, 201, 240, 255}) {
    std::vector<int> yuy2;
    for (int cb = 0; cb < 256; ++cb)
      for (int y = 0; y < 256; y += 2) yuy2.insert(yuy2.end(), {y, cb, y + 1, cr});
    const auto image = decode_raw_color(bytes_of(yuy2), {RawColorFormat::yuy2, 256, 256});
    ASSERT_TRUE(image) << image.error().message;
    for (int cb = 0; cb < 256; ++cb)
      for (int y = 0; y < 256; ++y) {
        const Rgb8 right = by_the_book(y, cb, cr);
        for (int c = 0; c < 3; ++c)
          ASSERT_NEAR(image->at(y, cb)[c], right[c], 1) << y << " " << cb << " " << cr;
      }
  }
}

TEST(RawColor, Nv12ChromaHoldsForFourPixels) {
  // 4x2: Y counts, two chroma samples.
  const auto image =
      decode_raw_color(bytes_of({20, 40, 60, 80, 100, 120, 140, 160, 90, 240, 200, 16}),
                       {RawColorFormat::nv12, 4, 2});
  ASSERT_TRUE(image) << image.error().message;
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 4; ++x)
      EXPECT_EQ(pixel(*image, x, y),
                by_the_book(20 + 20 * x + 80 * y, x < 2 ? 90 : 200, x < 2 ? 240 : 16));
}

TEST(RawColor, BgraIsTurnedAroundAndLosesItsLastByte) {
  const auto image =
      decode_raw_color(bytes_of({1, 2, 3, 99, 4, 5, 6, 99}), {RawColorFormat::bgra, 1, 2});
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->data, (ImageRgb::Values{3, 2, 1, 6, 5, 4}));
}

TEST(RawColor, OrdersOfChannelsAreToldApart) {
  const auto decoded = [](RawColorFormat format, const std::vector<int>& bytes) {
    const auto image = decode_raw_color(bytes_of(bytes), {format, 2, 1});
    return image ? image->data : ImageRgb::Values();
  };
  const ImageRgb::Values right{1, 2, 3, 4, 5, 6};
  EXPECT_EQ(decoded(RawColorFormat::rgb, {1, 2, 3, 4, 5, 6}), right);
  EXPECT_EQ(decoded(RawColorFormat::bgr, {3, 2, 1, 6, 5, 4}), right);
  EXPECT_EQ(decoded(RawColorFormat::rgba, {1, 2, 3, 99, 4, 5, 6, 99}), right);
  EXPECT_EQ(decoded(RawColorFormat::uyvy, {90, 40, 200, 60}),
            decoded(RawColorFormat::yuy2, {40, 90, 60, 200}));
  EXPECT_FALSE(decoded(RawColorFormat::uyvy, {90, 40, 200, 60}).empty());
}

TEST(RawColor, GapsBetweenRowsAreSkipped) {
  for (const auto format :
       {RawColorFormat::nv12, RawColorFormat::yuy2, RawColorFormat::bgra, RawColorFormat::uyvy,
        RawColorFormat::rgb, RawColorFormat::bgr, RawColorFormat::rgba}) {
    const RawColorLayout tight{format, 6, 4};
    const int row = tight_stride_bytes(tight), stride = row + 5;
    const int rows = format == RawColorFormat::nv12 ? 6 : 4;
    std::vector<int> packed, spread;
    for (int y = 0; y < rows; ++y) {
      for (int i = 0; i < row; ++i) packed.push_back((37 * y + 11 * i) % 256);
      spread.insert(spread.end(), packed.end() - row, packed.end());
      spread.insert(spread.end(), 5, 255);
    }
    const auto a = decode_raw_color(bytes_of(packed), tight);
    const auto b = decode_raw_color(bytes_of(spread), {format, 6, 4, stride});
    spread.resize(spread.size() - 5);
    const auto c = decode_raw_color(bytes_of(spread), {format, 6, 4, stride});
    ASSERT_TRUE(a && b && c);
    EXPECT_EQ(*a, *b);
    EXPECT_EQ(*a, *c);
  }
}

TEST(RawColor, WrongSizesAreErrors) {
  const std::vector<std::byte> bytes(4 * 4 * 4);
  const std::span<const std::byte> all(bytes);
  for (const auto& [format, size] : {std::pair{RawColorFormat::nv12, 24u},
                                     {RawColorFormat::yuy2, 32u},
                                     {RawColorFormat::bgra, 64u}})
    for (const unsigned given : {0u, 1u, size - 1, size, size + 1}) {
      if (given > bytes.size()) continue;
      const auto image = decode_raw_color(all.first(given), {format, 4, 4});
      ASSERT_EQ(image.ok(), given == size) << given;
      if (!image) {
        EXPECT_THAT(image.error().message, testing::HasSubstr(std::to_string(size) + " bytes"));
      }
    }
  constexpr int kMost = std::numeric_limits<int>::max();
  for (const RawColorLayout& bad : {RawColorLayout{RawColorFormat::nv12, 3, 4},
                                    {RawColorFormat::nv12, 4, 3},
                                    {RawColorFormat::yuy2, 3, 4},
                                    {RawColorFormat::uyvy, 3, 4},
                                    {RawColorFormat::bgra, 0, 4},
                                    {RawColorFormat::bgra, 4, -1},
                                    {RawColorFormat::bgra, 4, 4, 15},
                                    {RawColorFormat::bgra, 4, 4, -16},
                                    {RawColorFormat::bgra, 4, 4, kMost},
                                    {RawColorFormat::bgra, kMost, kMost}})
    EXPECT_FALSE(decode_raw_color(all, bad)) << bad.width << "x" << bad.height;
}

}  // namespace
}  // namespace mr::kit
