#include "mr/kit/image_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "core/temp_dir.h"
#include "mr/core/file.h"
#include "support/pictures.h"

namespace mr::kit {
namespace {

using test::TempDir;
using testing::HasSubstr;

std::string text(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// A picture with enough texture that its JPEG is not trivially small.
ImageRgb noisy_picture() {
  ImageRgb image = test::gradient(80, 60);
  for (std::size_t i = 0; i < image.data.size(); i += 3)
    image.data[i + 2] = static_cast<std::uint8_t>(i * 2654435761u >> 24);
  return image;
}

TEST(ImageIo, PngGoesThroughUnchanged) {
  const TempDir dir;
  const ImageRgb image = noisy_picture();
  ASSERT_TRUE(write_png(dir / "a.png", image).ok());
  const auto back = read_color(dir / "a.png");
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(*back, image);
}

TEST(ImageIo, JpegKeepsColoursAndTheirOrder) {
  const TempDir dir;
  const ImageRgb image = test::gradient(64, 48);
  const auto coded = encode_jpeg(image, 95);
  ASSERT_TRUE(coded);
  const auto back = read_color(dir.write("a.jpg", text(*coded)));
  ASSERT_TRUE(back) << back.error().message;
  ASSERT_EQ(back->width, 64);
  ASSERT_EQ(back->height, 48);
  for (std::size_t i = 0; i < image.data.size(); ++i)
    ASSERT_LT(std::abs(image.data[i] - back->data[i]), 12) << i;
}

TEST(ImageIo, EveryTruncationIsAnError) {
  const TempDir dir;
  const auto jpeg = encode_jpeg(noisy_picture(), 80), png = encode_png(noisy_picture());
  ASSERT_TRUE(jpeg && png);
  for (const std::string& whole : {text(*jpeg), text(*png)})
    for (std::size_t keep = 0; keep < whole.size();
         keep += keep < 60 || keep + 20 > whole.size() ? 1 : whole.size() / 150) {
      const auto back = read_color(dir.write("cut", whole.substr(0, keep)));
      ASSERT_FALSE(back) << keep << " of " << whole.size();
      EXPECT_THAT(back.error().message, HasSubstr("cut"));
    }
}

TEST(ImageIo, EveryTruncatedDepthPictureIsAnError) {
  const TempDir dir;
  const auto image = test::counting_depth(9, 7);
  for (const std::string& whole : {test::depth_png(image), test::depth_pgm(image)})
    for (std::size_t keep = 0; keep < whole.size(); ++keep)
      ASSERT_FALSE(read_depth16(dir.write("cut", whole.substr(0, keep)))) << keep;
}

TEST(ImageIo, AFlippedBitInAPngIsAnError) {
  const TempDir dir;
  std::string whole = test::depth_png(test::counting_depth(9, 7));
  whole[whole.size() / 2] ^= 4;
  const auto back = read_depth16(dir.write("flipped.png", whole));
  ASSERT_FALSE(back);
  EXPECT_EQ(back.error().cause, Error::Cause::corrupt);
}

TEST(ImageIo, DepthPngAndPgmGiveTheSameCounts) {
  const TempDir dir;
  const auto image = test::counting_depth(33, 21);
  const auto png = read_depth16(dir.write("d.png", test::depth_png(image)));
  const auto pgm = read_depth16(dir.write("d.pgm", test::depth_pgm(image)));
  ASSERT_TRUE(png) << png.error().message;
  ASSERT_TRUE(pgm) << pgm.error().message;
  EXPECT_EQ(*png, image);
  EXPECT_EQ(*pgm, image);
}

TEST(ImageIo, PgmHeadersMayHoldCommentsAndMustFitTheData) {
  const TempDir dir;
  const auto good = read_depth16(dir.write("a", "P5 # x\n2#y\n 1\t300\nABCD"));
  ASSERT_TRUE(good) << good.error().message;
  EXPECT_EQ(good->data, (ImageDepth16::Values{0x4142, 0x4344}));
  for (const char* bad : {"P5 2 1 300\nABC", "P5 2 1 300\nABCDE", "P5 2 1 70000\nABCD",
                          "P5 2 1 0\nABCD", "P5 2 0 300\n", "P5 2 -1 300\nABCD", "P5 2", "P5",
                          "P5 2 1 300", "P5 9999999999 1 300\nAB", "P5 99999 99999 65535\n"})
    EXPECT_FALSE(read_depth16(dir.write("a", bad))) << bad;
}

TEST(ImageIo, EightBitDepthIsRefused) {
  const TempDir dir;
  const auto as_rgb = encode_png(test::gradient(8, 8));
  const auto as_jpeg = encode_jpeg(test::gradient(8, 8), 90);
  const std::string grey8 = test::png_file(2, 1, 8, 0, std::string("\0ab", 3));
  for (const std::string& bytes :
       {text(*as_rgb), text(*as_jpeg), grey8, std::string("P5 2 1 255\nab")}) {
    const auto back = read_depth16(dir.write("eight", bytes));
    ASSERT_FALSE(back);
    EXPECT_THAT(back.error().message, HasSubstr("depth must be 16-bit grey"));
    EXPECT_THAT(back.error().message, HasSubstr("eight"));
  }
}

TEST(ImageIo, SizesAreCheckedBeforeDecoding) {
  const TempDir dir;
  for (const auto& [w, h] :
       {std::pair{16385u, 1u}, {1u, 16385u}, {16000u, 16000u}, {0xFFFFFFFFu, 0xFFFFFFFFu}}) {
    const auto back = read_color(dir.write("bomb.png", test::png_file(w, h, 8, 2, "x")));
    ASSERT_FALSE(back);
    EXPECT_EQ(back.error().cause, Error::Cause::too_large) << w << "x" << h;
  }
  EXPECT_FALSE(read_color(dir.write("empty.png", test::png_file(0, 5, 8, 2, "x"))));
}

TEST(ImageIo, APngWithTooFewPixelsIsAnError) {
  const TempDir dir;
  testing::internal::CaptureStderr();  // libpng complains there
  EXPECT_FALSE(read_color(dir.write("few.png", test::png_file(40, 40, 8, 2, "abc"))));
  EXPECT_FALSE(read_depth16(dir.write("few.png", test::png_file(40, 40, 16, 0, "abc"))));
  testing::internal::GetCapturedStderr();
}

TEST(ImageIo, WrongKindsAndMissingFilesNameTheFile) {
  const TempDir dir;
  const auto missing = read_color(dir / "gone.jpg");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().cause, Error::Cause::not_found);
  EXPECT_THAT(missing.error().message, HasSubstr("gone.jpg"));
  EXPECT_FALSE(read_color(dir.write("note.txt", "hello, I am not a picture")));
  EXPECT_FALSE(read_color(dir.write("nothing.png", "")));
  EXPECT_FALSE(read_depth16(dir.write("note.txt", "hello, I am not a picture")));
  EXPECT_FALSE(encode_png({}));
  EXPECT_FALSE(write_png(dir / "no" / "folder.png", test::gradient(4, 4)).ok());
}

}  // namespace
}  // namespace mr::kit
