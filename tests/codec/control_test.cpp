#include "mr/codec/control.h"

#include <gtest/gtest.h>

#include "support/seal.h"

namespace mr::codec {
namespace {

Request full() {
  return {{0, 4, 0xFFFFFFFF},
          {{{{-1, 2, -3}, kMergedSource}, 0, 7}, {{{0, 0, 0}, 1, Layer::still}, 2, 0xFFFFFFFF}},
          1'234'567'890'123,
          true};
}

TEST(Request, RoundTrip) {
  for (const Request& request :
       {Request{}, full(), Request{{7}, {}, {}}, Request{{}, {}, 0}, Request{{}, {}, {}, true},
        Request{{}, {}, 3, false, 2}, Request{{}, {}, {}, false, 0},
        Request{{}, {}, {}, false, {}, true}}) {
    const auto back = decode_control(encode_control(request));
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(*back, request);
  }
}

TEST(Request, AnythingElseIsRefused) {
  const auto good = encode_control(full());
  for (std::size_t n = 0; n < good.size(); ++n)
    EXPECT_FALSE(decode_control(std::span(good).first(n))) << n;
  auto longer = good;
  longer.push_back({});
  EXPECT_FALSE(decode_control(longer));
  auto flags = good;
  flags[4] = std::byte{0x80};
  EXPECT_FALSE(decode_control(test::resealed(flags)));
  for (const std::size_t count : {9u, 13u}) {
    auto many = good;
    many[count] = std::byte{0xFF};
    const auto refused = decode_control(test::resealed(many));
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().cause, Error::Cause::too_large);
  }
  auto layer = good;
  layer[16 + 28 + 16] = std::byte{2};
  EXPECT_FALSE(decode_control(test::resealed(layer)));
  auto unsorted = good;
  unsorted[16 + 2 * 28] = std::byte{4};  // streams 4, 4, ...
  EXPECT_FALSE(decode_control(test::resealed(unsorted)));
  auto old = good;
  old[3] = std::byte{'T'};
  EXPECT_FALSE(decode_control(old));
}

TEST(Request, EveryFlippedBitIsSeen) {
  auto bytes = encode_control(full());
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    const std::byte mask{static_cast<unsigned char>(1u << bit % 8)};
    bytes[bit / 8] ^= mask;
    EXPECT_FALSE(decode_control(bytes)) << "bit " << bit;
    bytes[bit / 8] ^= mask;
  }
}

TEST(Request, TheTimeIsAnAnswerOfItsOwn) {
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

TEST(Request, AWishIsForOneStream) {
  const Request request = full();
  EXPECT_TRUE(request.wants_key_frame(4));
  EXPECT_FALSE(request.wants_key_frame(1));
  EXPECT_FALSE(Request{}.wants_key_frame(0));
}

/// Golden bytes: the browser writes the same.
TEST(Request, BytesAreFixed) {
  const auto bytes = encode_control({{6}, {{{{1, -1, 0}, 2, Layer::still}, 3, 4}}, {}, true});
  const unsigned char want[] = {'M', 'R', 'W', '3', 1,    0,    0,    0,    1, 0, 0, 0, 1, 0, 0, 0,
                                1,   0,   0,   0,   0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 0, 0, 2, 0, 0, 0,
                                1,   0,   0,   0,   3,    0,    0,    0,    4, 0, 0, 0, 6, 0, 0, 0};
  ASSERT_EQ(bytes.size(), sizeof want + kSealBytes);
  for (std::size_t i = 0; i < sizeof want; ++i) EXPECT_EQ(static_cast<unsigned>(bytes[i]), want[i]);
}

}  // namespace
}  // namespace mr::codec
