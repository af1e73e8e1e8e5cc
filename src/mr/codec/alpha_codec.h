#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/result.h"

namespace mr::codec {

/// Codes a binary alpha plane without loss (docs/wire-format.md, Alpha planes). Blocks of 8x8
/// pixels are all 0, all 1 or mixed, as the binary alpha blocks of MPEG-4 Visual (ISO/IEC 14496-2,
/// 6.1.3.8); the pixels of mixed blocks are coded by the ten known ones around them (the template
/// of JBIG, ITU-T T.82), all by an adaptive binary range coder. A person's outline takes about a
/// bit for each of its pixels. Deterministic. `plane`: not empty.
std::vector<std::byte> encode_alpha(const ImageMask& plane);

/// The plane of that size; both sides are at least 1 and the caller bounds them. invalid: more
/// bytes than the plane has use for. Whatever other bytes there are, they are a plane.
Result<ImageMask> decode_alpha(std::span<const std::byte> bytes, int width, int height);

}  // namespace mr::codec
