// VideoDecoder on any bytes: no crash, sizes within limits, and a valid key frame always heals it.
#include <cstdlib>

#include "mr/kit/video.h"
#include "patched.h"

namespace {

std::vector<std::byte> valid_unit() {
  auto encoder =
      mr::kit::VideoEncoder::create({.width = 48, .height = 32, .threads = 1, .slices = 2});
  if (!encoder) std::abort();
  mr::ImageRgb picture(48, 32);
  for (std::size_t i = 0; i < picture.data.size(); ++i)
    picture.data[i] = static_cast<std::uint8_t>(i * i / 50);
  return std::move(encoder->encode(picture)->data);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::vector<std::byte> valid = valid_unit();
  auto decoder = mr::kit::VideoDecoder::create();
  if (!decoder) std::abort();
  const auto unit = mr::fuzz::patched(valid, mr::fuzz::as_bytes(data, size));
  for (int round = 0; round < 2; ++round) {
    const auto picture = decoder->decode(unit);
    if (picture && (picture->width > 8192 || picture->height > 8192)) std::abort();
    if (round == 0 && !decoder->decode(valid)) std::abort();
  }
  return 0;
}
