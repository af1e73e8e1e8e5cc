// Any bytes as a 360-degree JPEG and as an uncoded picture: an error or a picture of the stated
// size.
#include <cstdlib>
#include <span>

#include "mr/kit/image_io.h"
#include "mr/kit/panorama_info.h"
#include "mr/kit/raw_color.h"
#include "patched.h"

namespace {

void check(bool good) {
  if (!good) std::abort();
}

void as_jpeg(std::span<const std::byte> bytes) {
  constexpr int kSmall = 1 << 20;  // pixels; larger ones only cost time
  const auto info = mr::kit::read_panorama_info(bytes);
  if (info) check(mr::is_rigid(mr::kit::T_upright_picture(*info)));
  auto picture = mr::kit::decode_color(bytes);
  if (!picture) return;
  check(!picture->empty() && picture->width <= 16384 && picture->height <= 16384);
  if (!info || picture->width * picture->height > kSmall || info->full_width > 4096) return;
  const auto whole = mr::kit::uncropped(*picture, *info);
  if (whole) check(whole->width >= picture->width && whole->height >= picture->height);
}

void as_raw(std::span<const std::byte> bytes) {
  if (bytes.size() < 4) return;
  const auto byte = [&](int i) { return std::to_integer<int>(bytes[static_cast<std::size_t>(i)]); };
  const auto format = static_cast<mr::kit::RawColorFormat>(byte(0) % 7);
  const mr::kit::RawColorLayout layout{format, byte(1), byte(2), byte(3) - 1};
  const auto picture = mr::kit::decode_raw_color(bytes.subspan(4), layout);
  if (picture) check(picture->width == layout.width && picture->height == layout.height);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = mr::fuzz::as_bytes(data, size);
  as_jpeg(bytes);
  as_raw(bytes);
  return 0;
}
