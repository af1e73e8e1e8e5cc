#include "mr/codec/control.h"

#include <gtest/gtest.h>

#include <limits>

#include "support/seal.h"

namespace mr::codec {
namespace {

constexpr std::size_t kBody = 8;  // after magic and version

Control full() {
  Control out{{StreamId{0}, StreamId{4}, StreamId{0xFFFFFFFF}},
              {{{{-1, 2, -3}, kMergedSource}, 0, 7},
               {{{0, 0, 0}, SensorId{1}, Layer::still}, 2, 0xFFFFFFFF}},
              1'234'567'890'123,
              true};
  out.shown = 77, out.time = true;
  out.plan.emplace();
  out.plan->sensors = {{0, 0.004}, 0.003, 7, 1, 20};
  out.plan->root = {{0.25, 0}, 0, 5, 0.3, 51, 0.5, 30};
  out.plan->by_sensor[SensorId{2}] = {{0, 0.008}, 0.003, 7, 1, 26};
  out.plan->by_sensor[SensorId{5}] = {{0, 0.016}, 0.003, 7, 0.5, 32};
  out.target_mbps = 4.5;
  return out;
}

/// With other bytes, checksum right.
Result<Control> with(std::vector<std::byte> bytes, std::size_t at, int value) {
  bytes.at(at) = static_cast<std::byte>(value);
  return decode_control(test::resealed(std::move(bytes)));
}

TEST(Control, RoundTrip) {
  Control plan;
  plan.plan.emplace();
  for (const Control& control :
       {Control{}, full(), plan, Control{{StreamId{7}}, {}, {}}, Control{{}, {}, 0},
        Control{{}, {}, {}, true}, Control{{}, {}, 3, false, 2}, Control{{}, {}, {}, false, 0},
        Control{{}, {}, {}, false, {}, true}}) {
    const auto back = decode_control(encode_control(control));
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(*back, control);
  }
}

TEST(Control, AnythingElseIsRefused) {
  const auto good = encode_control(full());
  for (std::size_t n = 0; n < good.size(); ++n)
    EXPECT_FALSE(decode_control(std::span(good).first(n))) << n;
  auto longer = good;
  longer.push_back({});
  EXPECT_FALSE(decode_control(longer));
  EXPECT_FALSE(with(good, 3, 'U')) << "magic";
  EXPECT_FALSE(with(good, kBody + 4, 8)) << "streams end later";
  EXPECT_FALSE(with(good, kBody + 4, 11)) << "no whole number of streams";
  EXPECT_FALSE(with(good, kBody + 8, 4)) << "streams 4, 4, …";
  const std::size_t chunks = kBody + 8 + 3 * 4;
  EXPECT_FALSE(with(good, chunks, 1)) << "sections out of order";
  EXPECT_FALSE(with(good, chunks + 8 + 16, 2)) << "an unknown layer";
}

TEST(Control, TooManyOfAnythingIsRefused) {
  const auto section = [](int kind, std::size_t bytes) {
    auto out = encode_control({});
    out.resize(kBody);
    for (const std::size_t v : {static_cast<std::size_t>(kind), bytes})
      for (int i = 0; i < 4; ++i) out.push_back(static_cast<std::byte>(v >> (8 * i) & 0xFF));
    for (std::size_t i = 0; i < bytes; ++i) out.push_back(static_cast<std::byte>(i / 4));
    seal(out);
    return decode_control(out);
  };
  for (const auto& [kind, bytes] : {std::pair(1, (Control::kMaxStreams + 1) * 4),
                                    std::pair(2, (Control::kMaxChunks + 1) * 28)}) {
    const auto refused = section(kind, bytes);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().cause, Error::Cause::too_large);
  }
}

TEST(Control, WhatALaterProgramAddsIsPassedOver) {
  auto bytes = encode_control(full());
  bytes.resize(bytes.size() - kSealBytes);
  for (const int b : {99, 0, 0, 0, 3, 0, 0, 0, 1, 2, 3}) bytes.push_back(static_cast<std::byte>(b));
  seal(bytes);
  const auto read = decode_control(bytes);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(*read, full());
}

TEST(Control, AnotherVersionIsRefusedInOneLineThatTheOtherSideGets) {
  const auto refused = with(encode_control(full()), 4, 2);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().cause, Error::Cause::unsupported);
  EXPECT_EQ(refused.error().message,
            "control: a message of version 2; this program reads version 1");
  const auto answer = decode_refusal(encode_refusal(refused.error().message));
  ASSERT_TRUE(answer && *answer);
  EXPECT_EQ(**answer, refused.error().message);
  EXPECT_FALSE(decode_refusal(encode_time(TimePoint{}))) << "another kind";
  EXPECT_EQ(**decode_refusal(encode_refusal(std::string(1000, 'x'))), std::string(kMostWhy, 'x'));
  EXPECT_EQ(**decode_refusal(encode_refusal("a\nb")), "a?b") << "one line";
  auto damaged = encode_refusal("why");
  damaged[5] ^= std::byte{1};
  EXPECT_FALSE(*decode_refusal(damaged));
}

TEST(Control, AnImpossiblePlanIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](auto change) {
    Control control;
    change(control.plan.emplace());
    return !decode_control(encode_control(control));
  };
  EXPECT_FALSE(refused([](ScenePlan&) {}));
  EXPECT_TRUE(refused([](ScenePlan& p) { p.sensors.decimation.ratio = 1.1; }));
  EXPECT_TRUE(refused([](ScenePlan& p) { p.root.decimation.error_m = -1; }));
  EXPECT_TRUE(refused([&](ScenePlan& p) { p.root.still_error_m = nan; }));
  EXPECT_TRUE(refused([](ScenePlan& p) { p.sensors.mesh_speed = 11; }));
  EXPECT_TRUE(refused([&](ScenePlan& p) { p.root.texture_scale = nan; }));
  EXPECT_TRUE(refused([](ScenePlan& p) { p.sensors.texture_qp = 52; }));
  EXPECT_TRUE(refused([&](ScenePlan& p) { p.root.plate_scale = nan; }));
  EXPECT_TRUE(refused([](ScenePlan& p) { p.root.plate_qp = -1; }));
  EXPECT_TRUE(refused([](ScenePlan& p) { p.by_sensor[SensorId{3}].texture_qp = 52; }));
  EXPECT_TRUE(refused([](ScenePlan& p) {
    for (std::size_t i = 0; i <= ScenePlan::kMaxSensors; ++i) p.by_sensor[sensor_at(i)] = {};
  }));
}

TEST(Control, ATargetThatIsNoRateIsRefused) {
  const auto is_read = [](double mbps) {
    Control control;
    control.target_mbps = mbps;
    EXPECT_FALSE(control.empty());
    return decode_control(encode_control(control)).ok();
  };
  for (const double good : {1e-3, 5.0, 1e5}) EXPECT_TRUE(is_read(good)) << good;
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  for (const double bad : {0.0, -1.0, kInfinite, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_FALSE(is_read(bad)) << bad;
}

TEST(Control, EveryFlippedBitIsSeen) {
  auto bytes = encode_control(full());
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    const std::byte mask{static_cast<unsigned char>(1u << bit % 8)};
    bytes[bit / 8] ^= mask;
    EXPECT_FALSE(decode_control(bytes)) << "bit " << bit;
    bytes[bit / 8] ^= mask;
  }
}

TEST(Control, TheTimeIsAnAnswerOfItsOwn) {
  const TimePoint now(std::chrono::nanoseconds(1'764'000'000'123'456'789));
  auto bytes = encode_time(now);
  const auto told = decode_time(bytes);
  ASSERT_TRUE(told && *told);
  EXPECT_EQ(**told, now);
  EXPECT_FALSE(decode_time(encode_control(full()))) << "another kind";
  bytes[7] ^= std::byte{1};
  const auto damaged = decode_time(bytes);
  ASSERT_TRUE(damaged);
  EXPECT_FALSE(*damaged);
}

TEST(Control, AWishIsForOneStream) {
  const Control control = full();
  EXPECT_TRUE(control.wants_key_frame(StreamId{4}));
  EXPECT_FALSE(control.wants_key_frame(StreamId{1}));
  EXPECT_FALSE(Control{}.wants_key_frame(StreamId{0}));
}

/// Golden bytes: the browser writes the same.
TEST(Control, BytesAreFixed) {
  const auto bytes =
      encode_control({{StreamId{6}}, {{{{1, -1, 0}, SensorId{2}, Layer::still}, 3, 4}}, {}, true});
  const unsigned char want[] = {
      'M', 'R', 'C', 'T', 1,  0, 0, 0,                                      // version
      1,   0,   0,   0,   4,  0, 0, 0, 6, 0, 0, 0,                          // key frames
      2,   0,   0,   0,   28, 0, 0, 0, 1, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF,  // chunks
      0,   0,   0,   0,   2,  0, 0, 0, 1, 0, 0, 0, 3,    0,    0,    0,    4, 0, 0, 0,  //
      4,   0,   0,   0,   0,  0, 0, 0};  // whole head
  ASSERT_EQ(bytes.size(), sizeof want + kSealBytes);
  for (std::size_t i = 0; i < sizeof want; ++i)
    EXPECT_EQ(static_cast<unsigned>(bytes[i]), want[i]) << i;
}

}  // namespace
}  // namespace mr::codec
