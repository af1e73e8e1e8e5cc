// Features of frames in packets, which a merger hands on to the root.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "mr/codec/head.h"
#include "mr/codec/packet_codec.h"

namespace mr::codec {
namespace {

Packet packet_with_features() {
  Packet out;
  out.scene = "s", out.node = "n", out.sequence = 7;
  out.features = {{SensorId{0}, true, {1.5f, -2, 0}}, {SensorId{3}, false, {}}};
  return out;
}

bool is_refused(const std::function<void(std::vector<FrameFeatures>&)>& change,
                Error::Cause cause = Error::Cause::invalid) {
  Packet packet = packet_with_features();
  change(packet.features);
  const auto out = decode_packet(encode_packet(packet));
  return !out && out.error().cause == cause;
}

TEST(FeaturePackets, FeaturesTravelWithTheirCapture) {
  Packet packet = packet_with_features();
  const auto back = decode_packet(encode_packet(packet));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(*back, packet);
  HeadWriter writer;
  HeadReader reader;
  for (int i = 0; i < 3; ++i, ++packet.sequence) {
    if (i == 2) packet.features.clear();
    const auto read = reader.read(writer.write(packet));
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->features, packet.features);
  }
}

TEST(FeaturePackets, ImpossibleOnesAreRefused) {
  EXPECT_FALSE(is_refused([](auto&) {}));
  EXPECT_TRUE(is_refused([](auto& all) { std::swap(all[0], all[1]); }));
  EXPECT_TRUE(is_refused([](auto& all) { all[1].sensor = all[0].sensor; }));
  EXPECT_TRUE(is_refused([](auto& all) { all[0].values[1] = std::nanf(""); }));
  EXPECT_TRUE(is_refused([](auto& all) { all[0].values[2] = HUGE_VALF; }));
  EXPECT_TRUE(is_refused([](auto& all) { all[1].values.resize(65); }, Error::Cause::too_large));
}

}  // namespace
}  // namespace mr::codec
