#pragma once

#include <cstddef>
#include <span>

#include "mr/core/image.h"
#include "mr/core/result.h"
#include "mr/kit/picture_header.h"

namespace mr::kit {

/// Whether bytes begin like a JPEG.
bool is_jpeg(std::span<const std::byte> bytes);

/// Reads the header of a JPEG that is whole. Errors as of decode_jpeg().
Result<PictureHeader> read_jpeg_header(std::span<const std::byte> bytes);

/// Decodes a JPEG by libjpeg-turbo: baseline and progressive, 8 bits, grey or of three channels
/// with any subsampling of chroma (which is interpolated). Any rotation that EXIF asks for is
/// ignored. Errors: corrupt (also truncated: never a picture whose rest is grey), too_large (over
/// 16384 a side or 64 million pixels), unsupported (CMYK, 12 bits). A thread keeps its decoder, so
/// that a stream of pictures pays for it once.
Result<ImageRgb> decode_jpeg(std::span<const std::byte> bytes);

/// The same into a picture whose memory is reused where it is large enough. After an error its
/// content is undefined.
Status decode_jpeg(std::span<const std::byte> bytes, ImageRgb& out);

}  // namespace mr::kit
