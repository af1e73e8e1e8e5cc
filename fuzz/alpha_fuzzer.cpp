// decode_alpha on any bytes: no crash; what it accepts can be coded again, to the same plane.
#include <cstdlib>

#include "mr/codec/alpha_codec.h"
#include "patched.h"

namespace {

using namespace mr;

constexpr int kWidth = 44, kHeight = 29;

std::vector<std::byte> valid_plane() {
  ImageMask plane(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) *plane.at(x, y) = (x - 20) * (x - 20) + y * y < 300;
  return codec::encode_alpha(plane);
}

}  // namespace

/// An input is a width and a height (modulo 64; 0: the valid plane's), and bytes or changes to
/// valid ones.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::vector<std::byte> valid = valid_plane();
  if (size < 2) return 0;
  const int width = data[0] % 64 == 0 ? kWidth : data[0] % 64;
  const int height = data[1] % 64 == 0 ? kHeight : data[1] % 64;
  const auto bytes = mr::fuzz::patched(valid, mr::fuzz::as_bytes(data + 2, size - 2));
  const auto plane = codec::decode_alpha(bytes, width, height);
  if (!plane) return 0;
  const auto again = codec::decode_alpha(codec::encode_alpha(*plane), width, height);
  if (!again || *again != *plane) std::abort();
  return 0;
}
