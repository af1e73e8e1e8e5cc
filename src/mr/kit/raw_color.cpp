#include "mr/kit/raw_color.h"

#include <algorithm>
#include <cstdint>
#include <string>

#include "mr/core/parallel.h"
#include "mr/kit/image_limits.h"

namespace mr::kit {
namespace {

constexpr std::size_t kRowsAtOnce = 64;

// BT.601 with 219 levels of luma and 224 of chroma, in 65536ths.
constexpr std::int32_t in_65536ths(double factor) {
  return static_cast<std::int32_t>(factor * 65536 + 0.5);
}
constexpr double kRed601 = 0.299, kBlue601 = 0.114, kGreen601 = 1 - kRed601 - kBlue601;
constexpr double kChromaLevels = 255.0 / 224;
constexpr std::int32_t kLuma = in_65536ths(255.0 / 219);
constexpr std::int32_t kCrToRed = in_65536ths(2 * (1 - kRed601) * kChromaLevels);
constexpr std::int32_t kCbToBlue = in_65536ths(2 * (1 - kBlue601) * kChromaLevels);
constexpr std::int32_t kCrToGreen =
    in_65536ths(2 * (1 - kRed601) * kRed601 / kGreen601 * kChromaLevels);
constexpr std::int32_t kCbToGreen =
    in_65536ths(2 * (1 - kBlue601) * kBlue601 / kGreen601 * kChromaLevels);

std::uint8_t level(std::int32_t in_65536) {
  return static_cast<std::uint8_t>(std::clamp(in_65536 >> 16, 0, 255));
}

/// Two pixels that share their chroma.
void pair_to_rgb(int y0, int y1, int cb, int cr, std::uint8_t* rgb) {
  cb -= 128, cr -= 128;
  constexpr std::int32_t kHalf = 1 << 15;
  const std::int32_t red = kCrToRed * cr + kHalf, blue = kCbToBlue * cb + kHalf;
  const std::int32_t green = kHalf - kCrToGreen * cr - kCbToGreen * cb;
  const std::int32_t first = kLuma * (y0 - 16), second = kLuma * (y1 - 16);
  rgb[0] = level(first + red), rgb[1] = level(first + green), rgb[2] = level(first + blue);
  rgb[3] = level(second + red), rgb[4] = level(second + green), rgb[5] = level(second + blue);
}

void nv12_row(const std::uint8_t* luma, const std::uint8_t* chroma, int width, std::uint8_t* rgb) {
  for (int x = 0; x < width; x += 2)
    pair_to_rgb(luma[x], luma[x + 1], chroma[x], chroma[x + 1], rgb + 3 * x);
}

void yuy2_row(const std::uint8_t* from, int width, std::uint8_t* rgb) {
  for (int x = 0; x < width; x += 2, from += 4)
    pair_to_rgb(from[0], from[2], from[1], from[3], rgb + 3 * x);
}

void uyvy_row(const std::uint8_t* from, int width, std::uint8_t* rgb) {
  for (int x = 0; x < width; x += 2, from += 4)
    pair_to_rgb(from[1], from[3], from[0], from[2], rgb + 3 * x);
}

/// Pixels of `bytes` bytes; red and blue are the first and the third, or the third and the first.
template <int bytes, bool blue_first>
void rgb_row(const std::uint8_t* from, int width, std::uint8_t* rgb) {
  for (int x = 0; x < width; ++x, from += bytes, rgb += 3) {
    const std::uint8_t first = from[0], green = from[1], third = from[2];
    rgb[0] = blue_first ? third : first, rgb[1] = green, rgb[2] = blue_first ? first : third;
  }
}

/// Converts a row of any format but nv12.
void packed_row(RawColorFormat format, const std::uint8_t* from, int width, std::uint8_t* rgb) {
  switch (format) {
    case RawColorFormat::yuy2:
      return yuy2_row(from, width, rgb);
    case RawColorFormat::uyvy:
      return uyvy_row(from, width, rgb);
    case RawColorFormat::rgb:
      return rgb_row<3, false>(from, width, rgb);
    case RawColorFormat::bgr:
      return rgb_row<3, true>(from, width, rgb);
    case RawColorFormat::rgba:
      return rgb_row<4, false>(from, width, rgb);
    default:
      return rgb_row<4, true>(from, width, rgb);
  }
}

bool shares_chroma(RawColorFormat format) {
  return format == RawColorFormat::nv12 || format == RawColorFormat::yuy2 ||
         format == RawColorFormat::uyvy;
}

const char* name_of(RawColorFormat format) {
  constexpr const char* kNames[] = {"NV12", "YUY2", "BGRA", "UYVY", "RGB", "BGR", "RGBA"};
  return kNames[static_cast<int>(format)];
}

std::string described(const RawColorLayout& l) {
  return std::string(name_of(l.format)) + " picture of " + std::to_string(l.width) + "x" +
         std::to_string(l.height) + " pixels";
}

/// Gaps between rows may be absent after the last one.
Status check_layout(const RawColorLayout& l, int stride, std::size_t byte_count) {
  const auto rows =
      static_cast<std::size_t>(l.format == RawColorFormat::nv12 ? l.height / 2 * 3 : l.height);
  const auto row_bytes = static_cast<std::size_t>(tight_stride_bytes(l));
  const auto step = static_cast<std::size_t>(stride);
  const std::size_t most = rows * step, least = most - step + row_bytes;
  if (byte_count >= least && byte_count <= most) return {};
  return Error{Error::Cause::corrupt, "a " + described(l) + " has " + std::to_string(most) +
                                          " bytes, not " + std::to_string(byte_count)};
}

}  // namespace

int tight_stride_bytes(const RawColorLayout& layout) {
  constexpr int kBytes[] = {1, 2, 4, 2, 3, 3, 4};
  return layout.width * kBytes[static_cast<int>(layout.format)];
}

Result<ImageRgb> decode_raw_color(std::span<const std::byte> bytes, const RawColorLayout& layout) {
  const int width = layout.width, height = layout.height;
  if (width < 1 || height < 1)
    return Error{Error::Cause::invalid, "a " + described(layout) + " is empty"};
  if (const auto fits = within_image_limits(width, height); !fits) return fits.error();
  const bool nv12 = layout.format == RawColorFormat::nv12;
  if ((shares_chroma(layout.format) && width % 2 != 0) || (nv12 && height % 2 != 0))
    return Error{Error::Cause::invalid, "a " + described(layout) + " must have even sides"};
  const int tight = tight_stride_bytes(layout);
  const int stride = layout.stride_bytes == 0 ? tight : layout.stride_bytes;
  if (stride < tight)
    return Error{Error::Cause::invalid, "rows of a " + described(layout) + " overlap: stride of " +
                                            std::to_string(stride) + " bytes"};
  if (const auto whole = check_layout(layout, stride, bytes.size()); !whole) return whole.error();
  ImageRgb out(width, height);
  const auto* const first = reinterpret_cast<const std::uint8_t*>(bytes.data());
  const auto row = [&](std::size_t y) { return first + y * static_cast<std::size_t>(stride); };
  parallel_for(height, kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) {
      std::uint8_t* const rgb = out.row(static_cast<int>(y));
      if (nv12)
        nv12_row(row(y), row(height + y / 2), width, rgb);
      else
        packed_row(layout.format, row(y), width, rgb);
    }
  });
  return out;
}

}  // namespace mr::kit
