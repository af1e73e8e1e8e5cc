// decode_control on any bytes, and with a checksum that fits: no crash, within the caps, and what
// it accepts reads the same again. The same of the other answers.
#include <cstdlib>

#include "mr/codec/control.h"
#include "mr/codec/seal.h"
#include "patched.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto input = mr::fuzz::as_bytes(data, size);
  static_cast<void>(mr::codec::decode_control(input));
  std::vector<std::byte> bytes(input.begin(), input.end());
  mr::codec::seal(bytes);
  static_cast<void>(mr::codec::decode_time(bytes));
  static_cast<void>(mr::codec::decode_refusal(bytes));
  const auto control = mr::codec::decode_control(bytes);
  if (!control) return 0;
  if (control->chunks.size() > mr::codec::Control::kMaxChunks ||
      control->key_frames.size() > mr::codec::Control::kMaxStreams ||
      (control->plan && !control->plan->problems().empty()))
    std::abort();
  const auto again = mr::codec::decode_control(mr::codec::encode_control(*control));
  if (!again || !(*again == *control)) std::abort();
  return 0;
}
