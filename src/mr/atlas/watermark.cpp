#include "mr/atlas/watermark.h"

#include <algorithm>

namespace mr::atlas {
namespace {

constexpr int kSquare = 16, kColumns = 8, kBits = 16;

}  // namespace

void draw_watermark(ImageRgb& picture, std::uint64_t number) {
  for (int bit = 0; bit < kBits; ++bit) {
    const int x0 = bit % kColumns * kSquare, y0 = bit / kColumns * kSquare;
    const std::uint8_t value = number >> (kBits - 1 - bit) & 1 ? 255 : 0;
    for (int y = y0; y < std::min(y0 + kSquare, picture.height); ++y)
      for (int x = x0; x < std::min(x0 + kSquare, picture.width); ++x)
        std::fill_n(picture.at(x, y), 3, value);
  }
}

}  // namespace mr::atlas
