#include "mr/node/coalesce_packets.h"

#include <memory>
#include <utility>
#include <vector>

#include "mr/codec/coalesce.h"
#include "mr/codec/packet_message.h"

namespace mr::node {

net::Message coalesce_packets(std::span<const net::Message> packets) {
  if (packets.size() == 1) return packets.front();
  std::vector<codec::PacketMessage> read;
  for (const net::Message& bytes : packets)
    if (auto packet = codec::read_message(bytes)) read.push_back(*std::move(packet));
  // Unreadable bytes are passed on: the receiver counts the error.
  if (read.empty()) return packets.back();
  return net::as_message(codec::encode_message(codec::coalesce(read)));
}

}  // namespace mr::node
