#include <gtest/gtest.h>

#include <random>

#include "mr/rate/sweep.h"
#include "rate/made_sweeps.h"

namespace mr::rate {
namespace {

/// Of numbers that five digits hold.
SweepFile file() {
  Sweep a;
  a.scene = "a \"room\", Zürich", a.layers = true, a.moment = 7, a.fps = 29.97, a.voxel_m = 0.008;
  a.features = {{"color_spatial", 1234.5}, {"sensors", 4}};
  a.geometries = {{0.5, 10, 19323, 3858}, {1.58, 9, 151.25, 27310987}};
  a.textures = {{1, 18, 159540, 31675}, {0.7, 46, 9826, 1460.3}};
  a.qualities = {{0, 1, 0.78647, 0.61234}, {1, 0, 0.92101, 0.8}};
  a.plates = {{22, 154320, 0.81}};
  a.stills = {{0.25, 812340, 0.8}};
  Sweep b = a;
  b.layers = false, b.moment = 0, b.plates.clear(), b.stills.clear();
  return {"0123abcd", {a, b}};
}

/// `text` with the first `from` replaced.
std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

void expect_corrupt(const std::string& text) {
  const auto read = sweeps_from_json(text);
  ASSERT_FALSE(read) << text;
  EXPECT_EQ(read.error().cause, Error::Cause::corrupt);
  EXPECT_EQ(read.error().message.find('\n'), std::string::npos);
}

TEST(SweepFile, ReadsBackWhatWasWritten) {
  const auto again = sweeps_from_json(to_json(file()));
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->scene_hash, file().scene_hash);
  const Sweep read = again->sweeps.at(0), written = file().sweeps[0];
  EXPECT_EQ(read.scene, written.scene);
  EXPECT_EQ(read.layers, written.layers);
  EXPECT_EQ(read.moment, written.moment);
  EXPECT_EQ(read.fps, written.fps);
  EXPECT_EQ(read.voxel_m, written.voxel_m);
  ASSERT_EQ(read.geometries.size(), 2u);
  EXPECT_EQ(read.geometries[1].error_voxels, 1.58);
  EXPECT_EQ(read.geometries[1].bits, 9);
  EXPECT_EQ(read.geometries[1].triangles, 27310987u);
  EXPECT_EQ(read.textures.at(1).scale, 0.7);
  EXPECT_EQ(read.textures.at(1).qp, 46);
  EXPECT_EQ(read.qualities.at(0).texture, 1u);
  EXPECT_NEAR(read.geometries[1].bytes, 151.25, 0.01);
  EXPECT_NEAR(read.textures[1].bytes, 1460.3, 0.01);
  EXPECT_NEAR(read.qualities[0].ssim, 0.78647, 1e-9);
  EXPECT_NEAR(read.qualities[0].moving_ssim, 0.61234, 1e-9);
  EXPECT_NEAR(read.features.at(0).value, 1234.5, 1e-6);
  EXPECT_NEAR(read.plates.at(0).ssim, 0.81, 1e-9);
  EXPECT_NEAR(read.stills.at(0).bytes, 812340, 1e-3);
  EXPECT_FALSE(again->sweeps.at(1).layers);
  EXPECT_TRUE(again->sweeps[1].plates.empty());
}

TEST(SweepFile, IsTheSameWhenWrittenAgain) {
  SweepFile made{"hash", made_training()};
  const std::string text = to_json(made);
  const auto again = sweeps_from_json(text);
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(to_json(*again), text);
}

TEST(SweepFile, OfAnotherVersionIsUnsupported) {
  const auto read = sweeps_from_json(replaced(to_json(file()), "\"version\": 2", "\"version\": 1"));
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().cause, Error::Cause::unsupported);
  EXPECT_NE(read.error().message.find("version 1"), std::string::npos);
}

TEST(SweepFile, RefusesQualitiesOfNoSetting) {
  const std::string text = to_json(file());
  expect_corrupt(replaced(text, "\"qualities\": [[0,1,", "\"qualities\": [[2,1,"));
  expect_corrupt(replaced(text, "\"qualities\": [[0,1,", "\"qualities\": [[0,2,"));
  expect_corrupt(replaced(text, "\"qualities\": [[0,1,", "\"qualities\": [[-1,1,"));
  expect_corrupt(replaced(text, "\"qualities\": [[0,1,", "\"qualities\": [[1e11,1,"));
}

TEST(SweepFile, RefusesImpossibleNumbers) {
  const std::string text = to_json(file());
  for (const char* number : {"-1", "1e13", "1e999", "NaN", "null", "\"5\"", "[]", "5,6"}) {
    const std::string bad = number;
    expect_corrupt(replaced(text, "[[0.5,", "[[" + bad + ","));
    expect_corrupt(replaced(text, ",19323.0,", "," + bad + ","));
    expect_corrupt(replaced(text, "159540.0", bad));
    expect_corrupt(replaced(text, "812340.0", bad));
  }
  for (const char* number : {"0", "-30", "null", "\"30\""}) {
    expect_corrupt(replaced(text, "29.97", number));
    expect_corrupt(replaced(text, "0.008", number));
  }
  expect_corrupt(replaced(text, "[1.0,18,", "[1.0,52,"));
  expect_corrupt(replaced(text, "[0.5,10,", "[0.5,1e11,"));
  expect_corrupt(replaced(text, "\"sensors\":4.0", "\"sensors\":\"four\""));
}

TEST(SweepFile, RefusesWhatIsMissing) {
  const std::string text = to_json(file());
  for (const char* name : {"scene_hash", "sweeps", "scene", "layers", "moment", "fps", "voxel_m",
                           "features", "geometries", "textures", "qualities", "plates", "stills"})
    expect_corrupt(replaced(text, '"' + std::string(name) + "\":", "\"other\":"));
}

TEST(SweepFile, RefusesText) {
  for (const char* text :
       {"", "no sweeps", "[]", "null", "3", "{\"version\": 2}", "{\"version\": \"1\"}",
        "\xff\xfe{}", "{\"version\": 2, \"scene_hash\": \"\", \"sweeps\": [1, 2]}"})
    expect_corrupt(text);
  expect_corrupt(std::string(100'000, '['));
}

TEST(SweepFile, TruncatedIsRefused) {
  std::string text = to_json(file());
  text.resize(text.size() - 2);  // without "}\n"
  for (std::size_t size = 0; size <= text.size(); ++size) expect_corrupt(text.substr(0, size));
}

TEST(SweepFile, WithFlippedBytesIsRefusedOrOfSettingsThatExist) {
  std::mt19937 random(1);
  const std::string text = to_json(file());
  int read_anyway = 0;
  for (int round = 0; round < 2000; ++round) {
    std::string wrong = text;
    wrong[random() % wrong.size()] ^= static_cast<char>(1 << random() % 8);
    const auto read = sweeps_from_json(wrong);
    if (!read) continue;
    ++read_anyway;
    for (const Sweep& sweep : read->sweeps)
      for (const Sweep::Quality& q : sweep.qualities) {
        EXPECT_LT(q.geometry, sweep.geometries.size());
        EXPECT_LT(q.texture, sweep.textures.size());
      }
  }
  EXPECT_GT(read_anyway, 100);
}

}  // namespace
}  // namespace mr::rate
