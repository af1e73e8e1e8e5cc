#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <utility>
#include <vector>

#include "mr/codec/head.h"
#include "mr/codec/receiver.h"
#include "mr/core/lattice.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"

namespace mr::test {

/// Who receives all packets of a node.
class PacketInbox {
 public:
  explicit PacketInbox(const Lattice& lattice) : receiver_(lattice) {}

  /// Takes a packet's bytes in, and returns it; a default one where that fails, and so does the
  /// test.
  Packet take(const Result<std::vector<std::byte>>& bytes) {
    EXPECT_TRUE(bytes) << bytes.error().message;
    if (!bytes) return {};
    auto packet = reader_.read(*bytes);
    EXPECT_TRUE(packet) << packet.error().message;
    if (!packet) return {};
    for (const Error& error : receiver_.accept(*packet)) ADD_FAILURE() << error.message;
    return *std::move(packet);
  }
  const codec::Receiver& receiver() const { return receiver_; }

 private:
  codec::HeadReader reader_;
  codec::Receiver receiver_;
};

}  // namespace mr::test
