#pragma once

#include <cstdint>
#include <string>

#include "mr/core/result.h"

namespace mr::kit {

/// Whether a picture of a size that a header claims may be decoded at all.
inline Status within_image_limits(std::uint64_t width, std::uint64_t height) {
  constexpr std::uint64_t kMaxSide = 16384, kMaxPixels = 64'000'000;
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
  if (width == 0 || height == 0)
    return Error{Error::Cause::corrupt, "the picture is empty (" + size + ")"};
  if (width > kMaxSide || height > kMaxSide || width * height > kMaxPixels)
    return Error{Error::Cause::too_large,
                 size + " pixels are more than 16384 a side or 64 million in all"};
  return {};
}

}  // namespace mr::kit
