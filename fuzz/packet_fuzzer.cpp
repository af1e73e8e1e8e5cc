// Decodes packets from any bytes, alone and in sequence: no crash; accepted packets can be encoded
// again and folded; and HeadReader reconstructs the packets that HeadWriter writes as differences.
//
// An input is one packet or several, each after its length (32 bits, little-endian), without
// checksums, which are appended here, as a wrong checksum would end every test early.
#include <cstdlib>
#include <cstring>
#include <optional>
#include <vector>

#include "mr/codec/alpha_codec.h"
#include "mr/codec/coalesce.h"
#include "mr/codec/head.h"
#include "mr/codec/packet_codec.h"
#include "mr/codec/receiver.h"
#include "mr/codec/seal.h"
#include "patched.h"

namespace {

using namespace mr;

void require(bool condition) {
  if (!condition) std::abort();
}

bool is_packet(std::span<const std::byte> bytes) {
  return bytes.size() >= 8 && std::memcmp(bytes.data() + 4, "MRP4", 4) == 0;
}

std::vector<std::span<const std::byte>> pieces(std::span<const std::byte> bytes) {
  if (is_packet(bytes)) return {bytes};
  std::vector<std::span<const std::byte>> out;
  while (bytes.size() >= 4 && out.size() < 16) {
    std::uint32_t size = 0;
    std::memcpy(&size, bytes.data(), sizeof size);
    bytes = bytes.subspan(4);
    out.push_back(bytes.first(std::min<std::size_t>(size, bytes.size())));
    bytes = bytes.subspan(out.back().size());
  }
  return out;
}

/// The same packet, written as its difference to the ones before.
struct Differences {
  codec::HeadWriter writer;
  codec::HeadReader reader;
};

void check_differences(const Packet& packet, std::optional<Differences>& pair) {
  if (!pair) pair.emplace();
  const auto back = pair->reader.read(pair->writer.write(packet));
  if (!back) {  // older than the one before
    require(back.error().cause != Error::Cause::not_found);
    return pair.reset();
  }
  Packet expected = packet;
  expected.streams = back->streams;
  require(*back == expected);
}

/// Also of streams that have no picture; small ones.
void decode_planes(const Packet& packet) {
  for (const AlphaPlane& plane : packet.alpha)
    if (plane.width * plane.height <= 1 << 16)
      static_cast<void>(codec::decode_alpha(plane.data, plane.width, plane.height));
}

void check_folds(std::vector<codec::PacketMessage> messages) {
  if (messages.empty()) return;
  const auto folded = codec::coalesce(messages);
  const auto back = codec::decode_message(codec::encode_message(folded));
  require(!back || back->sequence == folded.sequence);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  codec::HeadReader heads;
  std::optional<Differences> again;
  codec::Receiver receiver({});
  std::vector<codec::PacketMessage> messages;
  static_cast<void>(codec::decode_message(fuzz::as_bytes(data, size)));
  for (const auto piece : pieces(fuzz::as_bytes(data, size))) {
    std::vector<std::byte> bytes(piece.begin(), piece.end());
    codec::seal(bytes);
    if (const auto message = codec::decode_message(bytes)) messages.push_back(*message);
    const auto packet = heads.read(bytes);
    if (!packet) continue;
    const auto back = codec::decode_packet(codec::encode_packet(*packet));
    require(back && *back == *packet);
    check_differences(*packet, again);
    decode_planes(*packet);
    static_cast<void>(receiver.accept(*packet));
    static_cast<void>(receiver.scene());
  }
  check_folds(std::move(messages));
  return 0;
}
