#include "mr/codec/request.h"

#include <gtest/gtest.h>

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
        Request{{}, {}, 3, false, 2}, Request{{}, {}, {}, false, 0}}) {
    const auto back = decode_request(encode_request(request));
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(*back, request);
  }
}

TEST(Request, AnythingElseIsRefused) {
  const auto good = encode_request(full());
  for (std::size_t n = 0; n < good.size(); ++n)
    EXPECT_FALSE(decode_request(std::span(good).first(n))) << n;
  auto longer = good;
  longer.push_back({});
  EXPECT_FALSE(decode_request(longer));
  auto flags = good;
  flags[4] = std::byte{0x80};
  EXPECT_FALSE(decode_request(flags));
  for (const std::size_t count : {9u, 13u}) {
    auto many = good;
    many[count] = std::byte{0xFF};
    const auto refused = decode_request(many);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().cause, Error::Cause::too_large);
  }
  auto layer = good;
  layer[16 + 28 + 16] = std::byte{2};
  EXPECT_FALSE(decode_request(layer));
  auto unsorted = good;
  unsorted[16 + 2 * 28] = std::byte{4};  // streams 4, 4, ...
  EXPECT_FALSE(decode_request(unsorted));
  auto old = good;
  old[3] = std::byte{'T'};
  EXPECT_FALSE(decode_request(old));
}

TEST(Request, AWishIsForOneStream) {
  const Request request = full();
  EXPECT_TRUE(request.wants_key_frame(4));
  EXPECT_FALSE(request.wants_key_frame(1));
  EXPECT_FALSE(Request{}.wants_key_frame(0));
}

/// Golden bytes: the browser writes the same.
TEST(Request, BytesAreFixed) {
  const auto bytes = encode_request({{6}, {{{{1, -1, 0}, 2, Layer::still}, 3, 4}}, {}, true});
  const unsigned char want[] = {'M', 'R', 'W', '2', 1,    0,    0,    0,    1, 0, 0, 0, 1, 0, 0, 0,
                                1,   0,   0,   0,   0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 0, 0, 2, 0, 0, 0,
                                1,   0,   0,   0,   3,    0,    0,    0,    4, 0, 0, 0, 6, 0, 0, 0};
  ASSERT_EQ(bytes.size(), sizeof want);
  for (std::size_t i = 0; i < sizeof want; ++i) EXPECT_EQ(static_cast<unsigned>(bytes[i]), want[i]);
}

}  // namespace
}  // namespace mr::codec
