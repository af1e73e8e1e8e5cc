#include "mr/eval/ssim.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>

#include "mr/core/parallel.h"
#include "mr/core/vec.h"
#include "mr/kit/image_io.h"

namespace mr::eval {
namespace {

using Json = nlohmann::json;
using Path = std::filesystem::path;

const Path kStored = Path(MR_SOURCE_DIR) / "tests/data/ssim";
constexpr double kTolerance = 1e-5;  // the protocol asks for 1e-3

ImageLuma luma(const Path& file) {
  const auto picture = kit::read_color(file);
  if (picture) return luma_of(*picture);
  ADD_FAILURE() << picture.error().message;
  return ImageLuma(64, 64);
}

ImageMask mask_of(const Path& file) {
  const ImageLuma picture = luma(file);
  ImageMask mask(picture.width, picture.height);
  for (std::size_t i = 0; i < mask.data.size(); ++i) mask.data[i] = picture.data[i] > 0;
  return mask;
}

PictureScore score_of(const ImageLuma& reference, const ImageLuma& test,
                      const ImageMask& mask = {}) {
  const auto prepared = Ssim::prepare(reference);
  const auto score = prepared ? prepared->compare(test, mask) : prepared.error();
  if (score) return *score;
  ADD_FAILURE() << score.error().message;
  return {-2, -2, -2};
}

ImageLuma made(int width, int height, const std::function<double(int x, int y)>& value) {
  ImageLuma out(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) *out.at(x, y) = static_cast<float>(value(x, y));
  return out;
}

ImageLuma noise(int width, int height, unsigned seed, double middle = 128, double range = 100) {
  std::mt19937 random(seed);
  return made(width, height,
              [&](int, int) { return middle + range * (random() / 2147483648.0 - 1.0); });
}

/// Checks all pictures of a folder against values of make_values.py.
void expect_values(const Path& folder, const Json& values) {
  const ImageMask mask = mask_of(folder / "mask.png");
  for (const auto& [name, value] : values.items()) {
    SCOPED_TRACE(name);
    const std::string reference = name.substr(0, name.find('-'));
    const PictureScore score =
        score_of(luma(folder / (reference + ".png")), luma(folder / (name + ".png")), mask);
    EXPECT_NEAR(score.ssim_full, value.at("full").get<double>(), kTolerance);
    EXPECT_NEAR(score.ssim_masked, value.at("masked").get<double>(), kTolerance);
    EXPECT_NEAR(score.psnr_db, value.at("psnr").get<double>(), 1e-3);
  }
}

TEST(Ssim, AgreesWithStoredValuesOfScikitImage) {
  std::ifstream file(kStored / "values.json");
  const Json values = Json::parse(file);
  EXPECT_EQ(values.size(), 14u);
  expect_values(kStored, values);
}

std::string output_of(const std::string& command) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(command.c_str(), "r"),
                                                             &::pclose);
  std::string out;
  char piece[4096];
  while (pipe) {
    const std::size_t count = std::fread(piece, 1, sizeof piece, pipe.get());
    if (count == 0) break;
    out.append(piece, count);
  }
  return out;
}

ImageRgb random_picture(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  ImageRgb out(width, height);
  for (std::uint8_t& v : out.data) v = static_cast<std::uint8_t>(random() % 256);
  return out;
}

/// Pictures that are nowhere stored, of sizes that no vector length divides.
TEST(Ssim, AgreesWithScikitImageOnThisMachine) {
  if (std::system("/usr/bin/python3 -c 'import skimage, PIL, scipy' 2>/dev/null") != 0)
    GTEST_SKIP() << "/usr/bin/python3 has no scikit-image: only its stored values were compared";
  const Path folder =
      std::filesystem::temp_directory_path() / ("ssim_test_" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  const ImageRgb a = random_picture(67, 211, 1);
  ImageRgb b = random_picture(67, 211, 2), mask(67, 211);
  for (std::size_t i = 0; i < b.data.size(); i += i < 20000 ? 1 : 2) b.data[i] = a.data[i];
  for (std::size_t i = 0; i < mask.data.size(); i += 7777) mask.data[i] = 255;
  EXPECT_TRUE(kit::write_png(folder / "a.png", a));
  EXPECT_TRUE(kit::write_png(folder / "a-b.png", b));
  EXPECT_TRUE(kit::write_png(folder / "mask.png", mask));
  const std::string script = (kStored / "make_values.py").string();
  const std::string out = output_of("/usr/bin/python3 " + script + " " + folder.string());
  ASSERT_TRUE(Json::accept(out)) << out;
  const Json values = Json::parse(out);
  EXPECT_EQ(values.size(), 1u);
  expect_values(folder, values);
  std::filesystem::remove_all(folder);
}

/// The definition, term by term, in double.
double similarity_at(const ImageLuma& a, const ImageLuma& b, int x, int y) {
  double sum = 0, ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
  for (int j = -5; j <= 5; ++j)
    for (int i = -5; i <= 5; ++i) {
      const double w = std::exp(-(i * i + j * j) / (2 * 1.5 * 1.5));
      const double va = *a.at(x + i, y + j), vb = *b.at(x + i, y + j);
      sum += w, ma += w * va, mb += w * vb, aa += w * va * va, bb += w * vb * vb, ab += w * va * vb;
    }
  ma /= sum, mb /= sum;
  const double c1 = 2.55 * 2.55, c2 = 7.65 * 7.65;
  return (2 * ma * mb + c1) * (2 * (ab / sum - ma * mb) + c2) /
         ((ma * ma + mb * mb + c1) * (aa / sum - ma * ma + bb / sum - mb * mb + c2));
}

/// Bright and nearly flat: where floats would lose the variance under the square of the mean.
TEST(Ssim, KeepsItsPrecisionInFlatRegions) {
  for (const double level : {1.0, 128.0, 254.0}) {
    const ImageLuma a = noise(40, 30, 1, level, 0.3), b = noise(40, 30, 2, level, 0.3);
    double sum = 0;
    for (int y = 5; y < 25; ++y)
      for (int x = 5; x < 35; ++x) sum += similarity_at(a, b, x, y);
    EXPECT_NEAR(score_of(a, b).ssim_full, sum / (20 * 30), 1e-6) << level;
  }
}

TEST(Ssim, MaskCountsTheWindowsThatHoldOneOfItsPixels) {
  const ImageLuma a = noise(50, 40, 1), b = noise(50, 40, 2);
  for (const Vec2i at : {Vec2i{20, 18}, {0, 0}, {49, 39}, {3, 30}}) {
    ImageMask mask(50, 40);
    *mask.at(at.x, at.y) = 1;
    double sum = 0;
    int windows = 0;
    for (int y = std::max(5, at.y - 5); y <= std::min(34, at.y + 5); ++y)
      for (int x = std::max(5, at.x - 5); x <= std::min(44, at.x + 5); ++x)
        sum += similarity_at(a, b, x, y), ++windows;
    const PictureScore score = score_of(a, b, mask);
    EXPECT_NEAR(score.ssim_masked, sum / windows, 1e-5) << at.x << ' ' << at.y;
    EXPECT_EQ(score.ssim_full, score_of(a, b).ssim_full);
    const double d = *a.at(at.x, at.y) - *b.at(at.x, at.y);
    EXPECT_NEAR(score.psnr_db, 20 * std::log10(255 / std::abs(d)), 1e-4);
  }
}

TEST(Ssim, MaskAcrossBandsOfRows) {
  const ImageLuma a = noise(30, 300, 1), b = noise(30, 300, 2);
  ImageMask mask(30, 300);
  double sum = 0;
  int windows = 0;
  for (int y = 0; y < 300; ++y) *mask.at(15, y) = y >= 90 && y < 250;
  for (int y = 85; y < 255; ++y)
    for (int x = 10; x <= 20; ++x) sum += similarity_at(a, b, x, y), ++windows;
  EXPECT_NEAR(score_of(a, b, mask).ssim_masked, sum / windows, 1e-5);
}

TEST(Ssim, SamePictureIsExactlyOne) {
  const ImageLuma a = noise(123, 217, 1);
  const PictureScore score = score_of(a, a);
  EXPECT_EQ(score.ssim_full, 1);
  EXPECT_EQ(score.ssim_masked, 1);
  EXPECT_EQ(score.psnr_db, kSamePsnr_db);
}

TEST(Ssim, EmptyAndFullMasks) {
  const ImageLuma a = noise(64, 48, 1), b = noise(64, 48, 2);
  const PictureScore none = score_of(a, b, ImageMask(64, 48)), all = score_of(a, b);
  EXPECT_EQ(none.ssim_masked, 1);
  EXPECT_EQ(none.psnr_db, kSamePsnr_db);
  EXPECT_LT(all.ssim_masked, 0.5);
  EXPECT_EQ(all.ssim_masked, all.ssim_full);
  const PictureScore full = score_of(a, b, ImageMask(64, 48, 1));
  EXPECT_EQ(full.ssim_masked, all.ssim_full);
  EXPECT_EQ(full.psnr_db, all.psnr_db);
}

TEST(Ssim, SmallestPictureIsOneWindow) {
  const ImageLuma a = noise(11, 11, 1), b = noise(11, 11, 2);
  EXPECT_NEAR(score_of(a, b).ssim_full, similarity_at(a, b, 5, 5), 1e-5);
}

TEST(Ssim, RefusesWhatItCannotCompare) {
  const auto cause = [](const auto& result) {
    return result ? std::string("none") : std::string(cause_name(result.error().cause));
  };
  EXPECT_EQ(cause(Ssim::prepare(ImageLuma(10, 30))), "invalid");
  EXPECT_EQ(cause(Ssim::prepare(ImageLuma(30, 10))), "invalid");
  EXPECT_EQ(cause(Ssim::prepare({})), "invalid");
  const auto reference = Ssim::prepare(noise(30, 20, 1));
  ASSERT_TRUE(reference);
  EXPECT_EQ(cause(reference->compare(noise(20, 30, 1))), "invalid");
  EXPECT_EQ(cause(reference->compare(noise(30, 20, 1), ImageMask(20, 30))), "invalid");
  for (const float wrong : {std::nanf(""), std::numeric_limits<float>::infinity(), -1e30f}) {
    ImageLuma test = noise(30, 20, 1);
    *test.at(29, 0) = wrong;
    EXPECT_EQ(cause(reference->compare(test)), "invalid") << wrong;
    EXPECT_EQ(cause(reference->compare(test, ImageMask(30, 20))), "invalid") << wrong;
    EXPECT_EQ(cause(Ssim::prepare(test)), "invalid") << wrong;
  }
}

TEST(Ssim, OneAndEightThreadsAgree) {
  const ImageLuma a = noise(320, 403, 1), b = noise(320, 403, 2);
  ImageMask mask(320, 403);
  for (int y = 50; y < 350; ++y) *mask.at(y % 300, y) = 1;
  const auto with = [&](int threads) {
    PictureScore score;
    Arena(threads).run([&] { score = score_of(a, b, mask); });
    return score;
  };
  const PictureScore one = with(1), eight = with(8);
  EXPECT_EQ(one.ssim_full, eight.ssim_full);
  EXPECT_EQ(one.ssim_masked, eight.ssim_masked);
  EXPECT_EQ(one.psnr_db, eight.psnr_db);
}

TEST(Luma, WeighsTheChannels) {
  ImageRgb picture(2, 2);
  picture.data = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255};
  const ImageLuma luma = luma_of(picture);
  EXPECT_FLOAT_EQ(luma.data[0], 54.213f);
  EXPECT_FLOAT_EQ(luma.data[1], 182.376f);
  EXPECT_FLOAT_EQ(luma.data[2], 18.411f);
  EXPECT_FLOAT_EQ(luma.data[3], 255);
}

}  // namespace
}  // namespace mr::eval
