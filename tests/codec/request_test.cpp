#include "mr/codec/request.h"

#include <gtest/gtest.h>

namespace mr::codec {
namespace {

Request full() {
  return {true,
          {{{{-1, 2, -3}, kMergedSource}, 0, 7}, {{{0, 0, 0}, 1}, 2, 0xFFFFFFFF}},
          1'234'567'890'123};
}

TEST(Request, RoundTrip) {
  for (const Request& request : {Request{}, full(), Request{true, {}, {}}, Request{false, {}, 0}}) {
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
  auto many = good;
  many[9] = std::byte{0xFF};
  const auto refused = decode_request(many);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().cause, Error::Cause::too_large);
}

/// Golden bytes: the browser writes the same.
TEST(Request, BytesAreFixed) {
  const auto bytes = encode_request({true, {{{{1, -1, 0}, 2}, 3, 4}}, {}});
  const unsigned char want[] = {'M', 'R', 'W', 'T', 1,    0,    0,    0,    1, 0, 0, 0,
                                1,   0,   0,   0,   0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 0, 0,
                                2,   0,   0,   0,   3,    0,    0,    0,    4, 0, 0, 0};
  ASSERT_EQ(bytes.size(), sizeof want);
  for (std::size_t i = 0; i < sizeof want; ++i) EXPECT_EQ(static_cast<unsigned>(bytes[i]), want[i]);
}

}  // namespace
}  // namespace mr::codec
