// decode_packet on any bytes: no crash, and what it accepts can be sent on.
#include <cstdlib>

#include "mr/codec/packet_codec.h"
#include "mr/codec/receiver.h"
#include "patched.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto packet = mr::codec::decode_packet(mr::fuzz::as_bytes(data, size));
  if (!packet) return 0;
  const auto again = mr::codec::decode_packet(mr::codec::encode_packet(*packet));
  if (!again || again->sequence != packet->sequence || again->manifest != packet->manifest)
    std::abort();
  mr::codec::Receiver receiver({});
  static_cast<void>(receiver.accept(*packet));
  static_cast<void>(receiver.scene());
  return 0;
}
