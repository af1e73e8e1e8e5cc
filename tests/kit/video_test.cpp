#include "mr/kit/video.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace mr::kit {
namespace {

constexpr std::array<std::array<std::uint8_t, 3>, 8> kBars = {{{255, 255, 255},
                                                               {255, 255, 0},
                                                               {0, 255, 255},
                                                               {0, 255, 0},
                                                               {255, 0, 255},
                                                               {255, 0, 0},
                                                               {0, 0, 255},
                                                               {0, 0, 0}}};

ImageRgb bars(int width, int height) {
  ImageRgb out(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      std::copy_n(kBars[static_cast<std::size_t>(x * 8 / width)].data(), 3, out.at(x, y));
  return out;
}

/// A smooth picture with some texture that moves with `t`.
ImageRgb waves(int width, int height, int t) {
  ImageRgb out(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c)
        out.at(x, y)[c] = static_cast<std::uint8_t>(128 + 60 * std::sin(0.05 * (x + 2 * t) + c) +
                                                    40 * std::cos(0.07 * y - 0.03 * x * c));
  return out;
}

double psnr_db(const ImageRgb& a, const ImageRgb& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    const double d = static_cast<double>(a.data[i]) - b.data[i];
    sum += d * d;
  }
  return 10 * std::log10(255.0 * 255.0 * static_cast<double>(a.data.size()) / std::max(sum, 1e-9));
}

VideoEncoder encoder(VideoSettings settings) {
  auto out = VideoEncoder::create(settings);
  EXPECT_TRUE(out) << out.error().message;
  return std::move(*out);
}

VideoDecoder decoder() {
  auto out = VideoDecoder::create();
  EXPECT_TRUE(out);
  return std::move(*out);
}

int nal_units(const AccessUnit& unit, int type) {
  int count = 0;
  for (std::size_t i = 0; i + 3 < unit.data.size(); ++i)
    if (unit.data[i] == std::byte{0} && unit.data[i + 1] == std::byte{0} &&
        unit.data[i + 2] == std::byte{1})
      count += (std::to_integer<int>(unit.data[i + 3]) & 31) == type;
  return count;
}

TEST(Video, SaturatedColoursSurvive) {
  const ImageRgb picture = bars(320, 64);
  auto enc = encoder({.width = 320, .height = 64, .qp = 10});
  auto dec = decoder();
  const auto unit = enc.encode(picture);
  ASSERT_TRUE(unit);
  EXPECT_TRUE(unit->key_frame);
  const auto back = dec.decode(unit->data);
  ASSERT_TRUE(back) << back.error().message;
  ASSERT_EQ(back->width, 320);
  for (std::size_t bar = 0; bar < kBars.size(); ++bar)
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(back->at(static_cast<int>(bar) * 40 + 20, 32)[c], kBars[bar][c], 6)
          << "bar " << bar << " channel " << c;
}

TEST(Video, GreysKeepTheirLevel) {
  auto dec = decoder();
  for (const int level : {0, 16, 64, 128, 200, 255}) {
    auto enc = encoder({.width = 64, .height = 64, .qp = 4});
    const auto back =
        dec.decode(enc.encode(ImageRgb(64, 64, static_cast<std::uint8_t>(level)))->data);
    ASSERT_TRUE(back);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(back->at(30, 30)[c], level, 2);
  }
}

TEST(Video, QualityFollowsTheQuantiser) {
  double last_db = 100;
  std::size_t last_bytes = 1u << 30;
  for (const auto& [qp, least_db] : {std::pair{0, 42.0}, {10, 40.0}, {22, 36.0}, {32, 30.0}}) {
    auto enc = encoder({.width = 320, .height = 240, .qp = qp});
    auto dec = decoder();
    std::size_t bytes = 0;
    double db = 0;
    for (int t = 0; t < 5; ++t) {
      const ImageRgb picture = waves(320, 240, t);
      const auto unit = enc.encode(picture);
      ASSERT_TRUE(unit);
      EXPECT_EQ(unit->key_frame, t == 0);
      bytes += unit->data.size();
      const auto back = dec.decode(unit->data);
      ASSERT_TRUE(back) << back.error().message;
      db = psnr_db(picture, *back);
      EXPECT_GT(db, least_db) << "qp " << qp << " frame " << t;
    }
    EXPECT_LE(db, last_db + 0.5);
    EXPECT_LT(bytes, last_bytes);
    last_db = db, last_bytes = bytes;
  }
}

TEST(Video, AnotherQuantiserGoesOnWithoutAKeyFrame) {
  auto coder = encoder({.width = 320, .height = 240, .qp = 20, .key_frame_every = 0});
  auto reader = decoder();
  const auto run = [&](int from, int to) {
    double sum = 0;
    for (int t = from; t < to; ++t) {
      const ImageRgb picture = waves(320, 240, 3 * t);
      const auto unit = coder.encode(picture);
      EXPECT_EQ(unit->key_frame, t == 0) << t;
      sum += psnr_db(picture, *reader.decode(unit->data));
    }
    return sum / (to - from);
  };
  const double fine = run(0, 10);
  coder.set_qp(40);
  run(10, 12);
  const double coarse = run(12, 20);
  coder.set_qp(20);
  run(20, 24);
  const double fine_again = run(24, 32);
  EXPECT_GT(fine - coarse, 4) << "twenty steps of the quantiser";
  EXPECT_NEAR(fine_again, fine, 1);
}

/// Rows of a picture, [top, bottom).
ImageRgb rows_of(const ImageRgb& picture, int top, int bottom) {
  ImageRgb out(picture.width, bottom - top);
  std::copy_n(picture.row(top), out.data.size(), out.data.begin());
  return out;
}

TEST(Video, BandsAreRefinedOneByOne) {
  constexpr int kWidth = 320, kHeight = 240, kMiddle = 112;
  const ImageRgb picture = waves(kWidth, kHeight, 0);
  auto enc = encoder({.width = kWidth, .height = kHeight, .qp = 44, .bands = true});
  auto dec = decoder();
  const auto decoded = [&](const Result<AccessUnit>& unit) {
    EXPECT_TRUE(unit);
    return unit ? *dec.decode(unit->data) : ImageRgb(kWidth, kHeight);
  };
  const ImageRgb coarse = decoded(enc.encode(picture));
  enc.set_qp(18);
  const auto first = enc.encode_band(picture, {0, kMiddle});
  const ImageRgb half = decoded(first);
  EXPECT_FALSE(first->key_frame);
  constexpr int kBorder = 8;  // next to it, the deblocking filter works
  EXPECT_GT(psnr_db(rows_of(half, 0, kMiddle - kBorder), rows_of(picture, 0, kMiddle - kBorder)),
            psnr_db(rows_of(coarse, 0, kMiddle), rows_of(picture, 0, kMiddle)) + 6);
  const ImageRgb below = rows_of(picture, kMiddle + kBorder, kHeight);
  EXPECT_GT(psnr_db(rows_of(half, kMiddle + kBorder, kHeight), below),
            psnr_db(rows_of(coarse, kMiddle + kBorder, kHeight), below) - 0.1);
  const auto second = enc.encode_band(picture, {kMiddle, kHeight});
  const ImageRgb whole = decoded(second);
  const ImageRgb above = rows_of(picture, 0, kMiddle - kBorder);
  EXPECT_GT(psnr_db(rows_of(whole, 0, kMiddle - kBorder), above),
            psnr_db(rows_of(half, 0, kMiddle - kBorder), above) - 0.1);

  auto at_once = encoder({.width = kWidth, .height = kHeight, .qp = 44});
  ASSERT_TRUE(at_once.encode(picture));
  at_once.set_qp(18);
  const auto all = at_once.encode(picture);
  EXPECT_LT(first->data.size(), 0.7 * all->data.size());
  EXPECT_LT(first->data.size() + second->data.size(), 1.1 * all->data.size());
  EXPECT_NEAR(psnr_db(whole, picture), 45, 5);
}

TEST(Video, WhereBandsMayComeWholePicturesAreWhatTheyAre) {
  auto enc = encoder({.width = 320, .height = 240, .qp = 30}),
       with_bands = encoder({.width = 320, .height = 240, .qp = 30, .bands = true});
  for (int t = 0; t < 4; ++t) {
    const ImageRgb picture = waves(320, 240, t);
    const auto plain = enc.encode(picture), other = with_bands.encode(picture);
    ASSERT_TRUE(plain && other);
    EXPECT_NEAR(static_cast<double>(other->data.size()), static_cast<double>(plain->data.size()),
                0.02 * static_cast<double>(plain->data.size()));
  }
}

TEST(Video, KeyFramesOnDemandStandAlone) {
  auto enc = encoder({.width = 128, .height = 96});
  for (int t = 0; t < 12; ++t) {
    const bool wanted = t == 5 || t == 9;
    // A cut in the middle must not make a key frame by itself.
    const auto unit = enc.encode(t == 3 ? bars(128, 96) : waves(128, 96, t), wanted);
    ASSERT_TRUE(unit);
    EXPECT_EQ(unit->key_frame, wanted || t == 0);
    EXPECT_EQ(nal_units(*unit, 7), unit->key_frame ? 1 : 0);  // SPS
    EXPECT_EQ(nal_units(*unit, 8), unit->key_frame ? 1 : 0);  // PPS
    EXPECT_EQ(nal_units(*unit, 6), 0);                        // no notes
    if (!wanted) continue;
    auto late = decoder();
    EXPECT_TRUE(late.decode(unit->data));
  }
}

TEST(Video, SameInputAndSettingsGiveTheSameBytes) {
  for (const VideoSettings& settings :
       {VideoSettings{.width = 320, .height = 256},
        VideoSettings{.width = 320, .height = 256, .threads = 2, .slices = 2},
        VideoSettings{.width = 320, .height = 256, .threads = 1, .slices = 4},
        VideoSettings{.width = 320, .height = 256, .threads = 4, .slices = 4}}) {
    auto a = encoder(settings), b = encoder(settings);
    for (int t = 0; t < 6; ++t) {
      const auto ua = a.encode(waves(320, 256, t), t == 4),
                 ub = b.encode(waves(320, 256, t), t == 4);
      ASSERT_TRUE(ua && ub);
      EXPECT_EQ(ua->data, ub->data);
      EXPECT_EQ(nal_units(*ua, 5) + nal_units(*ua, 1), settings.slices);
    }
  }
}

TEST(Video, ImpossibleSettingsAreRefused) {
  EXPECT_FALSE(VideoEncoder::create({.width = 321, .height = 240}));
  EXPECT_FALSE(VideoEncoder::create({.width = 320, .height = 241}));
  EXPECT_FALSE(VideoEncoder::create({.width = 0, .height = 240}));
  EXPECT_FALSE(VideoEncoder::create({.width = 8194, .height = 240}));
  EXPECT_FALSE(VideoEncoder::create({.width = 320, .height = 240, .fps = 0}));
  EXPECT_FALSE(VideoEncoder::create({.width = 320, .height = 240, .qp = 52}));
  EXPECT_FALSE(VideoEncoder::create({.width = 320, .height = 240, .threads = 0}));
  auto enc = encoder({.width = 64, .height = 64});
  EXPECT_FALSE(enc.encode(ImageRgb(64, 32)));
  EXPECT_TRUE(enc.encode(ImageRgb(64, 64)));
}

TEST(Video, SmallAndOddlyProportionedPictures) {
  for (const auto& [w, h] : {std::pair{2, 2}, {16, 2}, {2, 64}, {1026, 34}}) {
    auto enc = encoder({.width = w, .height = h, .qp = 10, .threads = 2, .slices = 2});
    auto dec = decoder();
    const auto unit = enc.encode(ImageRgb(w, h, 90));
    ASSERT_TRUE(unit);
    const auto back = dec.decode(unit->data);
    ASSERT_TRUE(back) << w << "x" << h << " " << back.error().message;
    EXPECT_EQ(back->width, w);
    EXPECT_EQ(back->height, h);
  }
}

TEST(Video, GarbageIsAnErrorAndTheNextKeyFrameHeals) {
  auto enc = encoder({.width = 128, .height = 96, .qp = 20});
  auto dec = decoder();
  EXPECT_FALSE(dec.decode({}));
  std::mt19937 random(7);
  std::vector<std::byte> garbage(500);
  for (std::byte& b : garbage) b = static_cast<std::byte>(random());
  EXPECT_FALSE(dec.decode(garbage));
  ASSERT_TRUE(dec.decode(enc.encode(waves(128, 96, 0))->data));
  ASSERT_TRUE(dec.decode(enc.encode(waves(128, 96, 1))->data));
  EXPECT_FALSE(dec.decode(garbage));
  EXPECT_FALSE(dec.decode(enc.encode(waves(128, 96, 2))->data)) << "refers to what may be lost";
  const auto back = dec.decode(enc.encode(waves(128, 96, 3), true)->data);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_GT(psnr_db(*back, waves(128, 96, 3)), 34);
  EXPECT_TRUE(dec.decode(enc.encode(waves(128, 96, 4))->data));
}

TEST(Video, AStreamStartsWithAKeyFrame) {
  auto enc = encoder({.width = 128, .height = 96});
  ASSERT_TRUE(enc.encode(waves(128, 96, 0)));
  auto late = decoder();
  EXPECT_FALSE(late.decode(enc.encode(waves(128, 96, 1))->data));
  EXPECT_TRUE(late.decode(enc.encode(waves(128, 96, 2), true)->data));
}

TEST(Video, TruncatedUnitsAreErrors) {
  auto enc = encoder({.width = 256, .height = 192, .qp = 20, .threads = 2, .slices = 2});
  std::vector<AccessUnit> units;
  for (int t = 0; t < 2; ++t) units.push_back(*enc.encode(waves(256, 192, t)));
  auto dec = decoder();
  const auto key = std::span<const std::byte>(units[0].data);
  const auto next = std::span<const std::byte>(units[1].data);
  for (int part = 1; part < 20; ++part) {
    EXPECT_FALSE(dec.decode(key.first(key.size() * part / 20))) << part;
    ASSERT_TRUE(dec.decode(key)) << part;
    EXPECT_FALSE(dec.decode(next.first(next.size() * part / 20))) << part;
  }
  ASSERT_EQ(nal_units(units[0], 5), 2);
  std::size_t last_slice = units[0].data.size() - 5;
  while (std::to_integer<int>(key[last_slice + 3]) != 0x65 || key[last_slice + 2] != std::byte{1} ||
         key[last_slice + 1] != std::byte{0} || key[last_slice] != std::byte{0})
    --last_slice;
  EXPECT_FALSE(dec.decode(key.first(last_slice))) << "one of two slices is missing";
  EXPECT_TRUE(dec.decode(key));
}

TEST(Video, DamageNeverCrashesAndAlwaysHeals) {
  auto enc = encoder({.width = 96, .height = 64, .qp = 24, .threads = 2, .slices = 2});
  const AccessUnit key = *enc.encode(waves(96, 64, 0));
  const AccessUnit next = *enc.encode(waves(96, 64, 1));
  auto dec = decoder();
  std::mt19937 random(3);
  for (int i = 0; i < 500; ++i) {
    AccessUnit damaged = i % 2 != 0 ? key : next;
    for (int flips = 1 + static_cast<int>(random() % 4); flips > 0; --flips)
      damaged.data[random() % damaged.data.size()] ^= static_cast<std::byte>(1u << random() % 8);
    if (const auto out = dec.decode(damaged.data)) {
      EXPECT_LE(std::max(out->width, out->height), 8192);
    }
    const auto healed = dec.decode(key.data);
    ASSERT_TRUE(healed) << healed.error().message;
    EXPECT_GT(psnr_db(*healed, waves(96, 64, 0)), 32);
  }
}

TEST(Video, AStreamMayChangeItsSizeAtAKeyFrame) {
  auto dec = decoder();
  for (const int side : {64, 128, 32}) {
    auto enc = encoder({.width = side, .height = side});
    const auto back = dec.decode(enc.encode(waves(side, side, 0))->data);
    ASSERT_TRUE(back);
    EXPECT_EQ(back->width, side);
  }
}

}  // namespace
}  // namespace mr::kit
