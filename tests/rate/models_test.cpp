#include "mr/rate/models.h"

#include <gtest/gtest.h>

#include <random>

#include "core/temp_dir.h"
#include "mr/rate/hull_targets.h"
#include "rate/made_sweeps.h"

namespace mr::rate {
namespace {

using Which = RateConfig::Model;
constexpr Which kAll[] = {Which::classifier, Which::lookup, Which::ours};

/// A small file: three scenes of one kind, one of the other.
const Models& small_models() {
  static const Models models = [] {
    const auto layers = made_scenes(), without_layers = made_scenes(false);
    return Models::train(made_sweeps({layers[0], layers[2], layers[3], without_layers[2]}));
  }();
  return models;
}

const std::string& small_file() {
  static const std::string text = to_json(small_models());
  return text;
}

/// Of scenes and targets of many sizes, with and without what was produced.
std::vector<std::pair<Observation, double>> questions() {
  std::vector<std::pair<Observation, double>> out;
  for (const bool layers : {true, false})
    for (const double moving : {0.3, 1.3, 4.0})
      for (const double textured : {0.4, 1.1}) {
        const Sweep sweep =
            made_sweep({.layers = layers, .moving = moving, .textured = textured, .per_qp = 0.1});
        const RateSurface truth(grid_values(sweep));
        Observation observed{layers, sweep.features, {}};
        for (const Setting& setting : {kUsualSetting, Setting{2, 10, 0.7, 40}}) {
          for (const double target : log_spaced(0.4, 50, 9)) out.emplace_back(observed, target);
          observed.produced.push_back(made_produced(truth, setting));
        }
      }
  return out;
}

void expect_choices_without_crash(const Models& models) {
  for (const Which which : kAll)
    for (const double target : {0.5, 5.0, 50.0}) {
      const Sweep sweep = made_sweep();
      const Observation observed{true, sweep.features, {{kUsualSetting, 1, 2}}};
      const Setting s = models.get(which)->choose(observed, target);
      EXPECT_TRUE(s.qp >= 0 && s.qp <= 51 && s.scale > 0 && s.scale <= 1 && s.error_voxels > 0);
    }
}

/// `text` with the first `from` behind `after` replaced.
std::string replaced(std::string text, const std::string& after, const std::string& from,
                     const std::string& to) {
  const std::size_t start = text.find(after);
  const std::size_t at = text.find(from, start + after.size());
  EXPECT_TRUE(start != std::string::npos && at != std::string::npos) << after;
  return text.replace(at, from.size(), to);
}

/// `text` with the number behind `after` replaced.
std::string with_number(std::string text, const std::string& after, const std::string& number) {
  const std::size_t start = text.find(after) + after.size();
  const std::size_t end = text.find_first_of(",]}", start);
  return text.replace(start, end - start, number);
}

TEST(ModelsFile, ReadsBackModelsThatChooseTheSame) {
  const Models models = Models::train(made_training());
  const auto again = models_from_json(to_json(models));
  ASSERT_TRUE(again) << again.error().message;
  for (const Which which : kAll)
    for (const auto& [observed, target] : questions())
      EXPECT_EQ(again->get(which)->choose(observed, target),
                models.get(which)->choose(observed, target))
          << static_cast<int>(which) << " at " << target;
}

TEST(ModelsFile, IsTheSameWhenWrittenAgain) {
  const auto again = models_from_json(small_file());
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(to_json(*again), small_file());
  EXPECT_LT(small_file().size(), 200'000u);
}

TEST(ModelsFile, OfAnotherVersionIsUnsupported) {
  for (const char* version : {"0", "1", "2", "4", "-1"}) {
    const auto read = models_from_json(with_number(small_file(), "\"version\": ", version));
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error().cause, Error::Cause::unsupported) << read.error().message;
  }
  EXPECT_EQ(models_from_json("{\"version\": 1}").error().cause, Error::Cause::unsupported);
}

TEST(ModelsFile, TruncatedIsRefused) {
  const std::string text = small_file().substr(0, small_file().size() - 2);  // without "}\n"
  for (std::size_t size = 0; size <= text.size(); size += 97) {
    const auto read = models_from_json(std::string_view(text).substr(0, size));
    ASSERT_FALSE(read) << size;
    EXPECT_EQ(read.error().cause, Error::Cause::corrupt);
  }
}

TEST(ModelsFile, WithFlippedBytesIsRefusedOrStillChooses) {
  std::mt19937 random(1);
  int refused = 0;
  for (int round = 0; round < 300; ++round) {
    std::string text = small_file();
    for (int flips = 1 + static_cast<int>(random() % 3); flips > 0; --flips)
      text[random() % text.size()] ^= static_cast<char>(1 << random() % 7);
    const auto read = models_from_json(text);
    refused += !read;
    if (read)
      expect_choices_without_crash(*read);
    else
      EXPECT_EQ(read.error().message.find('\n'), std::string::npos);
  }
  EXPECT_GT(refused, 30);
}

TEST(ModelsFile, WithDigitsChangedIsRefusedOrStillChooses) {
  std::mt19937 random(2);
  int read_anyway = 0;
  for (int round = 0; round < 300; ++round) {
    std::string text = small_file();
    for (int changes = 3; changes > 0;) {
      char& c = text[random() % text.size()];
      if (c < '0' || c > '9') continue;
      c = "0123456789e-"[random() % 12];
      --changes;
    }
    if (const auto read = models_from_json(text))
      ++read_anyway, expect_choices_without_crash(*read);
  }
  EXPECT_GT(read_anyway, 30);
}

TEST(ModelsFile, RefusesImpossibleNumbers) {
  const std::string& text = small_file();
  for (const char* place :
       {"\"mean\":[", "\"deviation\":[", "\"nominal\":[", "\"hull\":[[",
        "\"gamma\":", "\"labels\":[", "\"counts\":[", "\"rho\":[", "\"coefficients\":[[",
        "\"vectors\":[[", "\"at\":[", "\"entries\":[[", "\"layers\":[[["})
    for (const char* number : {"1e999", "-1e999", "NaN", "null", "\"7\"", "[]", "{}"}) {
      const auto read = models_from_json(with_number(text, place, number));
      ASSERT_FALSE(read) << place << number;
      EXPECT_EQ(read.error().cause, Error::Cause::corrupt);
    }
  for (const char* place : {"\"labels\":[", "\"counts\":["})
    for (const char* number : {"1e10", "-1e10", "1e300", "4294967297"})
      EXPECT_FALSE(models_from_json(with_number(text, place, number))) << place << number;
}

TEST(ModelsFile, RefusesImpossibleParts) {
  const std::string& text = small_file();
  for (const std::string& wrong :
       {with_number(text, "\"gamma\":", "0"), with_number(text, "\"gamma\":", "-1"),
        with_number(text, "\"counts\":[", "-1"), with_number(text, "\"counts\":[", "1000000"),
        with_number(text, "\"deviation\":[", "0"), with_number(text, "\"deviation\":[", "-3"),
        with_number(text, "\"mean\":[", "1,2"), with_number(text, "\"nominal\":[", "1,2"),
        with_number(text, "\"hull\":[[", "0"), with_number(text, "\"hull\":[[", "1e4"),
        with_number(text, "\"vectors\":[[", "1,2"), with_number(text, "\"layers\":[[[", "1,2"),
        replaced(text, "\"lookup\"", "\"rows\":[", "\"rows\":[],\"old\":["),
        replaced(text, "\"lookup\"", "\"entries\":[", "\"entries\":[],\"old\":["),
        replaced(text, "\"classifier\"", "\"hull\":[", "\"hull\":[],\"old\":["),
        replaced(text, "", "\"ours\"", "\"theirs\"")})
    EXPECT_FALSE(models_from_json(wrong));
}

TEST(ModelsFile, RefusesWhatIsNone) {
  for (const std::string_view text :
       {"", "null", "[]", "7", "\"version\"", "{\"version\": 3}", "{\"version\": \"3\"}",
        "{\"version\": 3, \"classifier\": [], \"lookup\": [], \"ours\": []}",
        "{\"version\": 3, \"classifier\": 1, \"lookup\": 2, \"ours\": 3}", "\xff\xfe"}) {
    const auto read = models_from_json(text);
    ASSERT_FALSE(read) << text;
    EXPECT_EQ(read.error().cause, Error::Cause::corrupt) << text;
  }
  const auto large = models_from_json(std::string((16 << 20) + 1, ' '));
  EXPECT_EQ(large.error().cause, Error::Cause::too_large);
  EXPECT_FALSE(models_from_json(std::string(100'000, '[')));
}

// What these models chose when this test was written, for a scene between those of the training.
TEST(Models, ChooseWhatTheyAlwaysChose) {
  const Sweep sweep = made_sweep({.moving = 1.2, .textured = 0.9, .per_qp = 0.1});
  const RateSurface truth(grid_values(sweep));
  const Observation observed{true, sweep.features, {made_produced(truth, kUsualSetting)}};
  constexpr double kTargets[] = {1.2, 3, 7};
  const Setting expected[3][3] = {
      {{6, 9, 0.5, 42}, {0.5, 10, 0.7, 30}, {0.5, 11, 1, 24}},  // classifier
      {{1.4, 9, 0.5, 39}, {0.5, 10, 1, 31}, {0.5, 11, 1, 21}},  // lookup
      {{1.4, 9, 0.5, 37}, {0.5, 9, 1, 31}, {0.5, 10, 1, 19}}};  // ours
  for (std::size_t m = 0; m < 3; ++m)
    for (std::size_t t = 0; t < 3; ++t)
      EXPECT_EQ(small_models().get(kAll[m])->choose(observed, kTargets[t]), expected[m][t])
          << m << ' ' << t;
}

TEST(LatticeOfEpoch, IsTheUsualOneWhereNothingIsControlled) {
  EXPECT_EQ(lattice_of_epoch({}, true, 0.01), kBits);
}

TEST(LatticeOfEpoch, IsWhatTheModelOfTheFileChoosesForTheTarget) {
  const test::TempDir folder;
  RateConfig config;
  config.model = Which::ours, config.model_file = folder.write("models.json", small_file());
  config.target_mbps = 0.6;
  EXPECT_EQ(lattice_of_epoch(config, true, 0.01), 9);
  config.target_mbps = 1000;
  EXPECT_EQ(lattice_of_epoch(config, true, 0.01), 11);
}

/// What the shipped file predicts: an error in it, or in reading it, shows here.
TEST(ShippedModels, ChooseAsTheyDidWhenTheyWereTrained) {
  const Result<Models>& models = shipped_models();
  ASSERT_TRUE(models) << models.error().message;
  Observation observed;
  observed.features = {{"color_spatial", 2800},   {"color_temporal", 450}, {"depth_spatial", 39000},
                       {"depth_temporal", 37000}, {"moving_percent", 3},   {"mask_percent", 7},
                       {"triangles", 20000},      {"sensors", 4}};
  observed.produced = {{kUsualSetting, 6, 5}};
  const auto chosen = [&](RateConfig::Model which) {
    std::vector<Setting> out;
    for (const double mbps : {4.0, 7.0, 10.0})
      out.push_back(models->get(which)->choose(observed, mbps));
    return out;
  };
  EXPECT_EQ(chosen(RateConfig::Model::classifier),
            (std::vector<Setting>{{1, 9, 0.5, 39}, {0.5, 9, 1, 36}, {0.5, 9, 1, 33}}));
  EXPECT_EQ(chosen(RateConfig::Model::lookup),
            (std::vector<Setting>{{1.4, 9, 0.5, 40}, {0.5, 9, 0.7, 36}, {0.5, 9, 1, 32}}));
  EXPECT_EQ(chosen(RateConfig::Model::ours),
            (std::vector<Setting>{{1, 9, 1, 37}, {0.5, 9, 1, 37}, {0.5, 9, 1, 29}}));
}

}  // namespace
}  // namespace mr::rate
