#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/result.h"
#include "mr/kit/picture_header.h"

namespace mr::kit {

using ImageDepth16 = Image<std::uint16_t, 1>;  ///< sensor counts

/// Reads the header of a JPEG or PNG. The file is checked to be whole; the picture is not decoded.
Result<PictureHeader> read_picture_header(const std::filesystem::path& file);

/// Reads JPEG or PNG as 8-bit RGB. Corrupt, truncated, oversized (over 16384 a side) and missing
/// files are errors that name the file.
Result<ImageRgb> read_color(const std::filesystem::path& file);

/// The same from memory; at most 2 GiB.
Result<ImageRgb> decode_color(std::span<const std::byte> bytes);

/// Reads a 16-bit grey PNG or binary PGM (P5, maxval over 255: big-endian).
Result<ImageDepth16> read_depth16(const std::filesystem::path& file);

Result<std::vector<std::byte>> encode_png(const ImageRgb& image);
Result<std::vector<std::byte>> encode_jpeg(const ImageRgb& image, int quality);

/// Writes a PNG; no partial file is left on failure.
Status write_png(const std::filesystem::path& file, const ImageRgb& image);

}  // namespace mr::kit
