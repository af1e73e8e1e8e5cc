#include "mr/atlas/burn.h"

#include <algorithm>

namespace mr::atlas {
namespace {

constexpr int kSquare = 16, kColumns = 8, kBits = 16;

}  // namespace

void burn_number(ImageRgb& picture, std::uint64_t number) {
  for (int bit = 0; bit < kBits; ++bit) {
    const int x0 = bit % kColumns * kSquare, y0 = bit / kColumns * kSquare;
    const std::uint8_t value = number >> (kBits - 1 - bit) & 1 ? 255 : 0;
    for (int y = y0; y < std::min(y0 + kSquare, picture.height); ++y)
      for (int x = x0; x < std::min(x0 + kSquare, picture.width); ++x)
        std::fill_n(picture.at(x, y), 3, value);
  }
}

std::optional<std::uint16_t> read_number(const ImageRgb& picture) {
  if (picture.width < kColumns * kSquare || picture.height < kBits / kColumns * kSquare)
    return std::nullopt;
  std::uint16_t number = 0;
  for (int bit = 0; bit < kBits; ++bit) {
    const int x = bit % kColumns * kSquare + kSquare / 2,
              y = bit / kColumns * kSquare + kSquare / 2;
    const std::uint8_t value = *picture.at(x, y);
    if (value > 64 && value < 192) return std::nullopt;
    number = static_cast<std::uint16_t>(number << 1 | (value > 128));
  }
  return number;
}

}  // namespace mr::atlas
