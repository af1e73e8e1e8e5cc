#include "mr/net/frames.h"

#include <gtest/gtest.h>

#include "mr/net/address.h"

namespace mr::net {
namespace {

std::vector<std::byte> encoded(FrameKind kind, std::uint64_t id, std::size_t bytes) {
  const auto header = encode_frame_header(kind, id, bytes);
  std::vector<std::byte> out(header.begin(), header.end());
  for (std::size_t i = 0; i < bytes; ++i) out.push_back(static_cast<std::byte>(i));
  return out;
}

const FrameLimits kLimits = {{FrameKind::packet, 1000}, {FrameKind::subscribe, 0}};

TEST(Frames, GoldenBytes) {
  const auto header = encode_frame_header(FrameKind::request, 0x0102030405060708u, 0x00A1B2C3u);
  const std::array<int, kFrameHeaderBytes> golden = {0xC3, 0xB2, 0xA1, 0, 5, 8, 7,
                                                     6,    5,    4,    3, 2, 1};
  for (std::size_t i = 0; i < golden.size(); ++i)
    EXPECT_EQ(std::to_integer<int>(header[i]), golden[i]) << i;
}

TEST(Frames, AnyCutGivesTheSameFrames) {
  std::vector<std::byte> stream = encoded(FrameKind::packet, 7, 300);
  for (const auto& more :
       {encoded(FrameKind::subscribe, 8, 0), encoded(FrameKind::packet, 9, 1000)})
    stream.insert(stream.end(), more.begin(), more.end());
  for (const std::size_t step : {std::size_t{1}, std::size_t{13}, std::size_t{64}, stream.size()}) {
    FrameReader reader(kLimits);
    std::vector<Frame> frames;
    for (std::size_t at = 0; at < stream.size(); at += step) {
      auto some = reader.feed(std::span(stream).subspan(at, std::min(step, stream.size() - at)));
      ASSERT_TRUE(some);
      for (Frame& frame : *some) frames.push_back(std::move(frame));
    }
    ASSERT_EQ(frames.size(), 3u);
    EXPECT_EQ(frames[0].payload.size(), 300u);
    EXPECT_EQ(frames[0].payload[299], std::byte{43});
    EXPECT_EQ(frames[1].kind, FrameKind::subscribe);
    EXPECT_EQ(frames[2].id, 9u);
    EXPECT_EQ(frames[2].payload.size(), 1000u);
  }
}

TEST(Frames, RefusesWhatIsTooLargeOrUnknown) {
  EXPECT_EQ(FrameReader(kLimits).feed(encoded(FrameKind::packet, 1, 1001)).error().cause,
            Error::Cause::too_large);
  EXPECT_EQ(FrameReader(kLimits).feed(encoded(FrameKind::subscribe, 1, 1)).error().cause,
            Error::Cause::too_large);
  EXPECT_EQ(FrameReader(kLimits).feed(encoded(FrameKind::answer, 1, 1)).error().cause,
            Error::Cause::corrupt);
  EXPECT_EQ(FrameReader(kLimits).feed(encoded(static_cast<FrameKind>(99), 1, 1)).error().cause,
            Error::Cause::corrupt);
}

TEST(Address, ReadsNamesAndNumbers) {
  EXPECT_EQ(parse_address("localhost:7000")->host, "localhost");
  EXPECT_EQ(parse_address("10.0.0.1:80")->port, "80");
  EXPECT_EQ(parse_address("[::1]:7000")->host, "::1");
  EXPECT_EQ(to_string(*parse_address("[::1]:7000")), "[::1]:7000");
  EXPECT_EQ(to_string(*parse_address("a:007")), "a:7");
  for (const char* bad : {"", ":", "host", "host:", ":80", "host:65536", "host:-1", "host:8x",
                          "::1:80", "[]:80", "[::1]", "[::1:80"})
    EXPECT_FALSE(parse_address(bad)) << bad;
}

}  // namespace
}  // namespace mr::net
