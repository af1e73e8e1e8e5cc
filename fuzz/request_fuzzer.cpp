// decode_request on any bytes: no crash, within the caps, and what it accepts has these very bytes.
#include <algorithm>
#include <cstdlib>

#include "mr/codec/request.h"
#include "patched.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = mr::fuzz::as_bytes(data, size);
  const auto request = mr::codec::decode_request(bytes);
  if (!request) return 0;
  if (request->chunks.size() > mr::codec::Request::kMaxChunks ||
      request->key_frames.size() > mr::codec::Request::kMaxStreams)
    std::abort();
  const auto again = mr::codec::encode_request(*request);
  if (!std::equal(bytes.begin(), bytes.end(), again.begin(), again.end())) std::abort();
  return 0;
}
