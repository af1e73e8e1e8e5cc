#include "mr/net/fragments.h"

#include <gtest/gtest.h>

#include "net_support.h"

namespace mr::net {
namespace {

using Parts = std::vector<std::vector<std::byte>>;
using namespace std::chrono_literals;

constexpr std::size_t kPayload = 116;  // room for 100 bytes in each part
const Reassembly::TimePoint kNow{};

Message numbered(std::size_t bytes) {
  std::vector<std::byte> out(bytes);
  for (std::size_t i = 0; i < bytes; ++i) out[i] = static_cast<std::byte>(i * 7 + i / 256);
  return as_message(std::move(out));
}

Parts cut(const Message& message, std::uint64_t id) {
  const auto parts = fragment_count(message->size(), kPayload);
  Parts out;
  for (std::uint16_t i = 0; i < *parts; ++i)
    out.push_back(fragment(*message, id, i, *parts, kPayload));
  return out;
}

TEST(Fragments, AnySizeComesBack) {
  Reassembly reassembly({});
  std::uint64_t id = 0;
  for (const std::size_t bytes : {0, 1, 99, 100, 101, 200, 5000}) {
    const Message in = numbered(bytes);
    const Parts parts = cut(in, ++id);
    EXPECT_EQ(parts.size(), std::max<std::size_t>(1, (bytes + 99) / 100));
    Message out;
    for (const auto& part : parts) {
      EXPECT_FALSE(out);
      EXPECT_LE(part.size(), kPayload);
      out = reassembly.accept(kNow, part);
    }
    ASSERT_TRUE(out) << bytes;
    EXPECT_EQ(*out, *in);
  }
  EXPECT_EQ(reassembly.lost(), 0u);
}

TEST(Fragments, PartsOfTwoSendersMayMix) {
  Reassembly reassembly({});
  const Message a = numbered(250), b = numbered(260);
  const Parts pa = cut(a, 1), pb = cut(b, 2);
  EXPECT_FALSE(reassembly.accept(kNow, pa[0]));
  EXPECT_FALSE(reassembly.accept(kNow, pb[0]));
  EXPECT_FALSE(reassembly.accept(kNow, pb[1]));
  EXPECT_FALSE(reassembly.accept(kNow, pa[1]));
  EXPECT_EQ(*reassembly.accept(kNow, pa[2]), *a);
  EXPECT_EQ(*reassembly.accept(kNow, pb[2]), *b);
}

TEST(Fragments, ALostPartLosesItsMessageOnly) {
  for (const std::size_t missing : {0u, 1u, 3u}) {
    Reassembly reassembly({});
    const Parts parts = cut(numbered(450), 1);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (i != missing) {
        EXPECT_FALSE(reassembly.accept(kNow, parts[i]));
      }
    }
    EXPECT_EQ(reassembly.lost(), 1u) << missing;
    EXPECT_TRUE(reassembly.accept(kNow, cut(numbered(10), 2)[0]));
  }
}

TEST(Fragments, TheLastPartLostIsNoticedInTime) {
  Reassembly reassembly({.patience = 2s});
  EXPECT_FALSE(reassembly.accept(kNow, cut(numbered(150), 1)[0]));
  EXPECT_TRUE(reassembly.accept(kNow + 1s, cut(numbered(10), 2)[0]));
  EXPECT_EQ(reassembly.lost(), 0u);
  EXPECT_TRUE(reassembly.accept(kNow + 2s, cut(numbered(10), 3)[0]));
  EXPECT_EQ(reassembly.lost(), 1u);
}

TEST(Fragments, KeepsToItsCaps) {
  Reassembly small({.message_bytes = 150});
  const Parts parts = cut(numbered(200), 1);
  EXPECT_FALSE(small.accept(kNow, parts[0]));
  EXPECT_FALSE(small.accept(kNow, parts[1]));
  EXPECT_EQ(small.lost(), 1u);

  Reassembly few({.messages = 2});
  for (std::uint64_t id = 1; id <= 5; ++id) few.accept(kNow + id * 1ms, cut(numbered(200), id)[0]);
  EXPECT_EQ(few.lost(), 3u);
  EXPECT_TRUE(few.accept(kNow + 9ms, cut(numbered(200), 5)[1]));

  Reassembly tight({.bytes = 250});
  for (std::uint64_t id = 1; id <= 5; ++id) tight.accept(kNow, cut(numbered(200), id)[0]);
  EXPECT_EQ(tight.lost(), 3u);
}

TEST(Fragments, GarbageIsCounted) {
  Reassembly reassembly({});
  const Parts parts = cut(numbered(200), 1);
  std::vector<std::byte> wrong = parts[0];
  wrong[0] = std::byte{0};
  EXPECT_FALSE(reassembly.accept(kNow, {}));
  EXPECT_FALSE(reassembly.accept(kNow, wrong));
  EXPECT_FALSE(reassembly.accept(kNow, std::span(parts[0]).first(15)));
  std::vector<std::byte> none = fragment({}, 3, 0, 0, kPayload);  // part 0 of 0
  EXPECT_FALSE(reassembly.accept(kNow, none));
  EXPECT_EQ(reassembly.lost(), 4u);
}

TEST(Fragments, CountKnowsItsLimits) {
  EXPECT_EQ(*fragment_count(100 * 0xFFFF, kPayload), 0xFFFF);
  EXPECT_FALSE(fragment_count(100 * 0xFFFF + 1, kPayload));
  EXPECT_FALSE(fragment_count(1, kFragmentHeaderBytes));
  EXPECT_FALSE(fragment_count(1, 0));
}

}  // namespace
}  // namespace mr::net
