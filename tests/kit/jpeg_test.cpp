#include "mr/kit/jpeg.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <thread>
#include <vector>

#include "support/jpeg_files.h"

namespace mr::kit {
namespace {

using testing::HasSubstr;
using Bytes = std::vector<std::byte>;

ImageRgb smooth(int width, int height) {
  ImageRgb out(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      out.at(x, y)[0] = static_cast<std::uint8_t>(255 * x / width);
      out.at(x, y)[1] = static_cast<std::uint8_t>(255 * y / height);
      out.at(x, y)[2] = static_cast<std::uint8_t>(200 - 100 * x / width);
    }
  return out;
}

int largest_difference(const ImageRgb& a, const ImageRgb& b) {
  int out = a.width == b.width && a.height == b.height ? 0 : 999;
  for (std::size_t i = 0; out < 999 && i < a.data.size(); ++i)
    out = std::max(out, std::abs(a.data[i] - b.data[i]));
  return out;
}

TEST(Jpeg, EverySubsamplingAndProgressiveGiveThePicture) {
  const ImageRgb picture = smooth(93, 61);
  for (const auto chroma : {test::JpegChroma::full, test::JpegChroma::half_width,
                            test::JpegChroma::half_height, test::JpegChroma::quarter})
    for (const bool progressive : {false, true}) {
      const Bytes coded = test::jpeg_file(picture, {95, chroma, progressive});
      ASSERT_TRUE(is_jpeg(coded));
      const auto back = decode_jpeg(coded);
      ASSERT_TRUE(back) << back.error().message;
      EXPECT_LE(largest_difference(*back, picture), 8) << static_cast<int>(chroma) << progressive;
    }
}

TEST(Jpeg, GreyBecomesThreeEqualChannels) {
  const auto back = decode_jpeg(test::jpeg_file(smooth(40, 30), {95, test::JpegChroma::none}));
  ASSERT_TRUE(back) << back.error().message;
  for (std::size_t i = 0; i < back->data.size(); i += 3) {
    ASSERT_EQ(back->data[i], back->data[i + 1]);
    ASSERT_EQ(back->data[i], back->data[i + 2]);
  }
  EXPECT_LT(back->at(0, 0)[0] + 100, back->at(39, 29)[0]);
}

TEST(Jpeg, APictureIsReusedAndAnErrorLeavesTheDecoderUsable) {
  const Bytes large = test::jpeg_file(smooth(80, 60), {}),
              small = test::jpeg_file(smooth(16, 9), {});
  const auto alone = decode_jpeg(small);
  ASSERT_TRUE(alone);
  ImageRgb out;
  ASSERT_TRUE(decode_jpeg(large, out).ok());
  const void* const memory = out.data.data();
  EXPECT_FALSE(decode_jpeg(std::span(large).first(large.size() / 2), out).ok());
  ASSERT_TRUE(decode_jpeg(small, out).ok());
  EXPECT_EQ(out, *alone);
  EXPECT_EQ(out.data.data(), memory);
  Result<ImageRgb> elsewhere = Error{};
  std::thread([&] { elsewhere = decode_jpeg(small); }).join();
  ASSERT_TRUE(elsewhere);
  EXPECT_EQ(*elsewhere, *alone);
}

/// A JPEG whose entropy-coded bytes end early, but with its end marker.
TEST(Jpeg, MissingDataBeforeTheEndMarkerIsAnErrorNotGrey) {
  for (const bool progressive : {false, true}) {
    const Bytes whole =
        test::jpeg_file(smooth(200, 160), {90, test::JpegChroma::quarter, progressive});
    Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(whole.size() * 3 / 4));
    while (cut.back() == std::byte{0xFF}) cut.pop_back();
    cut.insert(cut.end(), {std::byte{0xFF}, std::byte{0xD9}});
    const auto back = decode_jpeg(cut);
    ASSERT_FALSE(back) << progressive;
    EXPECT_EQ(back.error().cause, Error::Cause::corrupt);
    EXPECT_THAT(back.error().message, HasSubstr("truncated"));
    EXPECT_EQ(back.error().message.find('\n'), std::string::npos);
  }
}

TEST(Jpeg, StrayBytesBeforeTheEndMarkerAreHarmless) {
  // Many cameras pad their pictures in this way.
  for (const bool progressive : {false, true}) {
    const Bytes whole =
        test::jpeg_file(smooth(50, 40), {90, test::JpegChroma::quarter, progressive});
    Bytes padded(whole.begin(), whole.end() - 2);
    padded.insert(padded.end(), 5, std::byte{0});
    padded.insert(padded.end(), whole.end() - 2, whole.end());
    padded.insert(padded.end(), 7, std::byte{0});  // and after it
    const auto back = decode_jpeg(padded), expected = decode_jpeg(whole);
    ASSERT_TRUE(back) << back.error().message;
    ASSERT_TRUE(expected);
    EXPECT_EQ(*back, *expected);
  }
}

TEST(Jpeg, WhatIsNotReadSaysSo) {
  const auto cmyk = decode_jpeg(test::cmyk_jpeg_file(16, 16));
  ASSERT_FALSE(cmyk);
  EXPECT_EQ(cmyk.error().cause, Error::Cause::unsupported);
  EXPECT_THAT(cmyk.error().message, HasSubstr("CMYK"));
  Bytes deep = test::jpeg_file(smooth(16, 16), {});
  deep[test::jpeg_frame_header_at(deep) + 4] = std::byte{12};
  const auto twelve = decode_jpeg(deep);
  ASSERT_FALSE(twelve);
  EXPECT_THAT(twelve.error().message, HasSubstr("12 bits"));
  EXPECT_FALSE(decode_jpeg(Bytes{}));
  EXPECT_FALSE(decode_jpeg(Bytes(100)));
}

TEST(Jpeg, SizesAreCheckedBeforeDecoding) {
  Bytes huge = test::jpeg_file(smooth(16, 16), {});
  const std::size_t at = test::jpeg_frame_header_at(huge);
  for (const std::size_t i : {5u, 6u, 7u, 8u}) huge[at + i] = std::byte{0xFF};
  const auto back = decode_jpeg(huge);
  ASSERT_FALSE(back);
  EXPECT_EQ(back.error().cause, Error::Cause::too_large);
}

TEST(Jpeg, EveryChangedByteIsAnErrorOrAPictureOfTheStatedSize) {
  const Bytes whole = test::jpeg_file(smooth(32, 24), {70});
  const auto good = decode_jpeg(whole);
  ASSERT_TRUE(good);
  for (std::size_t i = 0; i < whole.size(); ++i)
    for (const int flip : {1, 0x80, 0xFF}) {
      Bytes bad = whole;
      bad[i] ^= static_cast<std::byte>(flip);
      const auto back = decode_jpeg(bad);
      if (back) {
        ASSERT_EQ(back->data.size(), static_cast<std::size_t>(back->width) * back->height * 3);
      }
      const auto next = decode_jpeg(whole);
      ASSERT_TRUE(next) << "after an error at " << i << ": " << next.error().message;
      ASSERT_EQ(*next, *good);
    }
}

}  // namespace
}  // namespace mr::kit
