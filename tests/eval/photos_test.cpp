#include "mr/eval/photos.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>

#include "eval/small_scene.h"
#include "mr/core/parallel.h"
#include "mr/eval/covered_ssim.h"
#include "mr/eval/ssim.h"
#include "mr/kit/image_io.h"
#include "mr/synth/truth.h"

namespace mr::eval {
namespace {

ImageLuma noise(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  ImageLuma out(width, height);
  for (float& v : out.data) v = static_cast<float>(random() % 256);
  return out;
}

ImageMask some_of(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  ImageMask out(width, height);
  for (std::uint8_t& v : out.data) v = random() % 3 != 0;
  return out;
}

CoveredScore score_of(const ImageLuma& test, const ImageLuma& reference, const ImageMask& mask) {
  const auto score = covered_ssim(test, reference, mask);
  if (score) return *score;
  ADD_FAILURE() << score.error().message;
  return {};
}

/// The definition, window by window: Gaussian weights of the covered pixels, scaled to the sum 1;
/// two passes for variances.
double by_definition(const ImageLuma& a, const ImageLuma& b, const ImageMask& mask) {
  double sum = 0, windows = 0;
  for (int y = 5; y + 5 < a.height; ++y)
    for (int x = 5; x + 5 < a.width; ++x) {
      if (*mask.at(x, y) == 0) continue;
      const auto mean_of = [&](const std::function<double(int, int)>& value) {
        double total = 0, weight = 0;
        for (int dy = -5; dy <= 5; ++dy)
          for (int dx = -5; dx <= 5; ++dx) {
            if (*mask.at(x + dx, y + dy) == 0) continue;
            const double w = std::exp(-(dx * dx + dy * dy) / (2 * 1.5 * 1.5));
            total += w * value(x + dx, y + dy), weight += w;
          }
        return total / weight;
      };
      const double ma = mean_of([&](int i, int j) { return *a.at(i, j); });
      const double mb = mean_of([&](int i, int j) { return *b.at(i, j); });
      const double va = mean_of([&](int i, int j) { return std::pow(*a.at(i, j) - ma, 2); });
      const double vb = mean_of([&](int i, int j) { return std::pow(*b.at(i, j) - mb, 2); });
      const double co =
          mean_of([&](int i, int j) { return (*a.at(i, j) - ma) * (*b.at(i, j) - mb); });
      const double c1 = std::pow(0.01 * 255, 2), c2 = std::pow(0.03 * 255, 2);
      sum += (2 * ma * mb + c1) * (2 * co + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
      ++windows;
    }
  return sum / windows;
}

TEST(CoveredSsim, IsSsimWhereAllIsCovered) {
  const ImageLuma a = noise(61, 47, 1), b = noise(61, 47, 2);
  ImageLuma near = a;
  for (std::size_t i = 0; i < near.data.size(); ++i) near.data[i] = 0.9f * a.data[i] + 4;
  const ImageMask all(61, 47, 1);
  for (const ImageLuma& test : {near, b}) {
    const auto expected = Ssim::prepare(a)->compare(test);
    const CoveredScore score = score_of(test, a, all);
    EXPECT_NEAR(score.ssim, expected->ssim_full, 1e-6);
    EXPECT_NEAR(score.psnr_db, expected->psnr_db, 1e-6);
    EXPECT_EQ(score.windows, 51u * 37u);
  }
}

TEST(CoveredSsim, IsTheDefinitionOverCoveredPixels) {
  const ImageLuma a = noise(40, 33, 3);
  ImageLuma b = noise(40, 33, 4);
  for (std::size_t i = 0; i < b.data.size(); ++i) b.data[i] = 0.7f * a.data[i] + 0.3f * b.data[i];
  const ImageMask mask = some_of(40, 33, 5);
  const double expected = by_definition(b, a, mask);
  EXPECT_GT(expected, 0.5);
  EXPECT_LT(expected, 0.95);
  EXPECT_NEAR(score_of(b, a, mask).ssim, expected, 1e-9);
}

TEST(CoveredSsim, WhatIsNotCoveredNeitherHelpsNorHarms) {
  const ImageLuma a = noise(50, 40, 6), b = noise(50, 40, 7);
  const ImageMask mask = some_of(50, 40, 8);
  ImageLuma black = b, white = b;
  for (std::size_t i = 0; i < mask.data.size(); ++i)
    if (!mask.data[i]) black.data[i] = 0, white.data[i] = 255;
  const CoveredScore one = score_of(black, a, mask), other = score_of(white, a, mask);
  EXPECT_EQ(one.ssim, other.ssim);
  EXPECT_EQ(one.psnr_db, other.psnr_db);
  ImageLuma same = a;
  for (std::size_t i = 0; i < mask.data.size(); ++i)
    if (!mask.data[i]) same.data[i] = 0;
  EXPECT_NEAR(score_of(same, a, mask).ssim, 1, 1e-9);
  EXPECT_EQ(score_of(same, a, mask).psnr_db, kSamePsnr_db);
}

TEST(CoveredSsim, NothingCoveredCountsNothingAndBadInputIsRefused) {
  const ImageLuma a = noise(20, 20, 9);
  EXPECT_EQ(score_of(a, a, ImageMask(20, 20)).windows, 0u);
  EXPECT_FALSE(covered_ssim(a, a, ImageMask(19, 20)));
  EXPECT_FALSE(covered_ssim(noise(10, 30, 1), noise(10, 30, 1), ImageMask(10, 30)));
  ImageLuma broken = a;
  broken.data[7] = std::nanf("");
  EXPECT_FALSE(covered_ssim(broken, a, ImageMask(20, 20)));
}

TEST(CoveredSsim, IsTheSameOnAnyNumberOfThreads) {
  const ImageLuma a = noise(90, 130, 10), b = noise(90, 130, 11);
  const ImageMask mask = some_of(90, 130, 12);
  CoveredScore one, eight;
  Arena(1).run([&] { one = score_of(a, b, mask); });
  Arena(8).run([&] { eight = score_of(a, b, mask); });
  EXPECT_EQ(one.ssim, eight.ssim);
  EXPECT_EQ(one.psnr_db, eight.psnr_db);
}

ImageRgb flat(int width, int height, std::array<std::uint8_t, 3> color) {
  ImageRgb out(width, height);
  for (std::size_t i = 0; i < out.data.size(); ++i) out.data[i] = color[i % 3];
  return out;
}

TEST(Exposure, GainIsFoundDespiteClippingAndWrongPixels) {
  ImageRgb rendered(40, 30);
  std::mt19937 random(1);
  for (std::uint8_t& v : rendered.data) v = static_cast<std::uint8_t>(random() % 200);
  ImageRgb photograph = exposed(rendered, 1.5);
  const ImageMask all(40, 30, 1);
  EXPECT_NEAR(exposure_gain(rendered, photograph, all), 1.5, 0.01);
  for (int x = 0; x < 40; ++x)
    for (int y = 0; y < 10; ++y) std::fill_n(photograph.at(x, y), 3, std::uint8_t{250});
  EXPECT_NEAR(exposure_gain(rendered, photograph, all), 1.5, 0.1) << "a third shows something else";
  for (int x = 0; x < 40; ++x)
    for (int y = 0; y < 25; ++y) std::fill_n(photograph.at(x, y), 3, std::uint8_t{255});
  EXPECT_NEAR(exposure_gain(rendered, photograph, all), 1.5, 0.01) << "clipped pixels do not count";
}

TEST(Exposure, OnlyCoveredPixelsCount) {
  ImageRgb rendered = flat(20, 20, {100, 90, 80}), photograph = exposed(rendered, 0.5);
  ImageMask half(20, 20);
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 20; ++x) {
      *half.at(x, y) = x < 9;
      if (x >= 9) std::fill_n(photograph.at(x, y), 3, std::uint8_t{200});
    }
  EXPECT_NEAR(exposure_gain(rendered, photograph, half), 0.5, 0.01);
  EXPECT_EQ(exposure_gain(rendered, photograph, ImageMask(20, 20)), 1);
  EXPECT_EQ(exposure_gain(flat(20, 20, {0, 0, 0}), photograph, half), 1);
  EXPECT_EQ(exposed(rendered, 1), rendered);
}

/// A small scene with photographs of its truth, taken by the colour camera of a sensor that is
/// moved to places where no sensor stands.
struct Photographed : SmallScene {
  PhotoConfig config;

  Photographed() : SmallScene() {
    config.photographs = {
        (folder / "photo-%03d.png").string(), (folder / "photo-%03d.txt").string(), {}};
    config.systems = {"meshreduce"};
    static const test::TempDir rendered;  // the same pictures for all tests
    config.rig_cache = rendered.path();
    const SensorConfig& sensor = scene.sensors[0];
    synth::Truth truth(*scene.rig, scene.fps);
    for (const int n : {2, 7}) {
      const Vec3d eye{0.2 * n - 0.8, 0.3, 1.5};
      const Pose T_world_depth = look_at(eye, eye + Vec3d{1, 0.4, -0.5}, {0, 0, 1});
      const Pose T_world_color = T_world_depth * sensor.T_color_depth.inverse();
      write(n, truth.render(undistorted(*sensor.color_camera), T_world_color, 0).color,
            T_world_depth);
    }
  }

  void write(int number, const ImageRgb& picture, const Pose& T_world_depth) const {
    const std::string name = fmt::format("photo-{:03}", number);
    const Status written = kit::write_png(folder / (name + ".png"), picture);
    if (!written) ADD_FAILURE() << written.error().message;
    std::string matrix;
    for (const double v : T_world_depth.matrix()) matrix += fmt::format("{} ", v);
    folder.write(name + ".txt", matrix);
  }
  PhotoReport report() const {
    auto made = compare_with_photographs(scene, config, {});
    if (made) return *std::move(made);
    ADD_FAILURE() << made.error().message;
    return {};
  }
  std::string refusal() const {
    const auto made = compare_with_photographs(scene, config, {});
    return made ? "not refused" : made.error().message;
  }
};

TEST(Photos, EverySystemIsMeasuredOnTheSamePixels) {
  Photographed setup;
  setup.config.systems = {"meshreduce", "vertex-colors", "points", "single-views",
                          "levelled-views"};
  setup.config.pictures = setup.folder / "pictures";
  const PhotoReport report = setup.report();
  ASSERT_EQ(report.photographs.size(), 2u);
  EXPECT_EQ(report.photographs[1].number, 7);
  ASSERT_EQ(report.systems.size(), 5u);
  for (const PhotoSystem& system : report.systems) {
    SCOPED_TRACE(system.name);
    EXPECT_GT(system.ssim, 0.4);
    EXPECT_LT(system.ssim, 1);
    EXPECT_GT(system.psnr_db, 13);
    EXPECT_GT(system.covered, 0.3);
    EXPECT_LE(system.covered, 1);
    for (const auto& score : system.scores) EXPECT_NEAR(score.value().gain, 1, 0.35);
  }
  const auto picture = kit::read_color(setup.folder / "pictures/photo-002.png");
  EXPECT_EQ(picture->width, 6 * 320);
  // The same surface, with other pictures.
  EXPECT_EQ(report.systems[3].covered, report.systems[4].covered);
  EXPECT_NE(report.systems[3].ssim, report.systems[4].ssim);
  // Alone, a system is measured on all that it covers: other figures, the same coverage.
  setup.config.systems = {"vertex-colors"};
  const PhotoReport alone = setup.report();
  EXPECT_EQ(alone.systems[0].covered, report.systems[1].covered);
  EXPECT_NE(alone.systems[0].ssim, report.systems[1].ssim);
}

TEST(Photos, AShiftedPoseScoresLower) {
  Photographed setup;
  setup.config.photographs.frames = {2};
  setup.config.systems = {"vertex-colors"};
  const double right = setup.report().systems[0].ssim;
  const Vec3d eye{-0.4, 0.3, 1.6};  // 10 cm too high
  setup.write(2, *kit::read_color(setup.folder / "photo-002.png"),
              look_at(eye, eye + Vec3d{1, 0.4, -0.5}, {0, 0, 1}));
  EXPECT_LT(setup.report().systems[0].ssim, right - 0.05);
}

TEST(Photos, WhatASensorDeliveredIsRefused) {
  Photographed setup;
  auto sources =
      node::open_sources(setup.scene, all_sensors(setup.scene.sensors), setup.config.rig_cache);
  const auto frame = sources[1]->next();
  setup.write(5, (**frame).color, (**frame).T_world_depth);
  EXPECT_THAT(setup.refusal(),
              testing::AllOf(testing::HasSubstr("photo-005.png"), testing::HasSubstr("--frames"),
                             testing::HasSubstr(setup.scene.sensors[1].id)));
  setup.config.photographs.frames = {7, 2};
  EXPECT_EQ(setup.report().photographs[0].number, 7) << "in the given order";
}

TEST(Photos, BadInputIsOneLine) {
  Photographed setup;
  const auto refused = [&](const char* word) {
    const std::string line = setup.refusal();
    EXPECT_THAT(line, testing::HasSubstr(word));
    EXPECT_EQ(line.find('\n'), std::string::npos);
  };
  PhotoSelection& photographs = setup.config.photographs;
  const PhotoSelection good = photographs;
  for (const char* pattern : {"photo.png", "%s.png", "%d-%d.png", "%n", "%999d.png", "%%", "%"}) {
    photographs.color = (setup.folder / pattern).string();
    refused("--color must hold one %d");
  }
  photographs = good, photographs.pose = "pose.txt";
  refused("--pose must hold one %d");
  photographs = good, photographs.color = (setup.folder / "none-%d.png").string();
  refused("no picture matches");
  photographs = good, photographs.frames = {3};
  refused("photo-003.png");
  photographs = good;
  setup.write(2, flat(64, 48, {1, 2, 3}), {});
  refused("expected 320x180");
  setup.write(2, flat(320, 180, {1, 2, 3}), {});
  setup.folder.write("photo-002.txt", "1 0 0 what");
  refused("photo-002.txt");
  std::filesystem::remove(setup.folder / "photo-002.txt");
  refused("photo-002.txt");
  photographs.frames = {7};
  setup.config.camera = "nobody";
  refused("no sensor 'nobody'");
}

TEST(Photos, NothingCoveredIsAnError) {
  Photographed setup;
  setup.write(2, flat(320, 180, {1, 2, 3}), look_at({0, 0, 500}, {0, 0, 600}, {1, 0, 0}));
  setup.config.photographs.frames = {2};
  EXPECT_THAT(setup.refusal(), testing::HasSubstr("poses"));
}

}  // namespace
}  // namespace mr::eval
