// decode_control on any bytes, and with a checksum that fits: no crash, within the caps, and what
// it accepts has these very bytes.
#include <algorithm>
#include <cstdlib>

#include "mr/codec/control.h"
#include "mr/codec/seal.h"
#include "patched.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto input = mr::fuzz::as_bytes(data, size);
  static_cast<void>(mr::codec::decode_control(input));
  static_cast<void>(mr::codec::decode_time(input));
  std::vector<std::byte> bytes(input.begin(), input.end());
  mr::codec::seal(bytes);
  static_cast<void>(mr::codec::decode_time(bytes));
  const auto request = mr::codec::decode_control(bytes);
  if (!request) return 0;
  if (request->chunks.size() > mr::codec::Control::kMaxChunks ||
      request->key_frames.size() > mr::codec::Control::kMaxStreams)
    std::abort();
  const auto again = mr::codec::encode_control(*request);
  if (!std::equal(bytes.begin(), bytes.end(), again.begin(), again.end())) std::abort();
  return 0;
}
