#include "mr/kit/jpeg.h"

#include <turbojpeg.h>

#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "mr/kit/image_limits.h"

namespace mr::kit {
namespace {

using JpegBytes = std::span<const std::uint8_t>;

constexpr std::size_t kMaxJpegBytes = 0x7FFFFFFF;
constexpr int kMaxJpegScans = 200;  // a progressive picture has about ten; thousands are an attack

/// What the markers of a JPEG claim.
struct JpegHeader {
  std::uint32_t width = 0, height = 0;  ///< pixels
  int bits = 8, channels = 3;
};

Error corrupt_jpeg(std::string what) { return {Error::Cause::corrupt, std::move(what)}; }

std::uint32_t jpeg_u16(JpegBytes b, std::size_t at) { return b[at] << 8 | b[at + 1]; }

bool starts_jpeg(JpegBytes b) {
  return b.size() >= 3 && b[0] == 0xFF && b[1] == 0xD8 && b[2] == 0xFF;
}

bool is_frame_header(std::uint8_t marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

/// The first marker at or after `at` that is neither a stuffed byte nor a restart; size() if none.
std::size_t end_of_scan(JpegBytes b, std::size_t at) {
  while (at + 1 < b.size()) {
    const void* found = std::memchr(&b[at], 0xFF, b.size() - 1 - at);
    if (found == nullptr) break;
    at = static_cast<std::size_t>(static_cast<const std::uint8_t*>(found) - b.data());
    const std::uint8_t next = b[at + 1];
    if (next != 0 && next != 0xFF && !(next >= 0xD0 && next <= 0xD7)) return at;
    ++at;
  }
  return b.size();
}

Status check_frame_header(const JpegHeader& h) {
  if (const auto fits = within_image_limits(h.width, h.height); !fits) return fits;
  if (h.channels == 4)
    return Error{Error::Cause::unsupported, "JPEG in CMYK is not read: convert it to RGB"};
  if (h.bits != 8)
    return Error{Error::Cause::unsupported,
                 "JPEG of " + std::to_string(h.bits) + " bits per channel is not read"};
  return {};
}

/// Checks that every segment is whole and that the picture ends with its EOI marker: libjpeg fills
/// what is missing with grey.
Result<JpegHeader> check_jpeg(JpegBytes b) {
  std::optional<JpegHeader> header;
  int scans = 0;
  for (std::size_t at = 2; at + 1 < b.size();) {
    if (b[at] != 0xFF) return corrupt_jpeg("JPEG marker missing");
    const std::uint8_t marker = b[at + 1];
    if (marker == 0xFF) {  // padding
      ++at;
      continue;
    }
    if (marker == 0xD9) {
      if (!header || scans == 0) return corrupt_jpeg("JPEG without a picture");
      return *header;
    }
    if (at + 4 > b.size()) break;
    const std::size_t length = jpeg_u16(b, at + 2);
    if (length < 2 || at + 2 + length > b.size()) break;
    if (is_frame_header(marker)) {
      if (length < 8 || header) return corrupt_jpeg("JPEG frame header is wrong");
      header = JpegHeader{jpeg_u16(b, at + 7), jpeg_u16(b, at + 5), b[at + 4], b[at + 9]};
      if (const auto good = check_frame_header(*header); !good) return good.error();
    }
    at += 2 + length;
    if (marker != 0xDA) continue;
    if (++scans > kMaxJpegScans) return corrupt_jpeg("JPEG has too many scans");
    at = end_of_scan(b, at);
  }
  return corrupt_jpeg("JPEG is truncated");
}

struct FreeTurboJpeg {
  void operator()(void* handle) const { tjDestroy(handle); }
};
using TurboJpeg = std::unique_ptr<void, FreeTurboJpeg>;

/// Warnings about pictures that are whole. TurboJPEG keeps the text of the first warning only; none
/// that matters follows stray bytes before the end marker (0xd9).
bool is_harmless(std::string_view warning) {
  for (const char* text : {"extraneous bytes before marker 0xd9", "unknown JFIF revision",
                           "Unknown Adobe color transform"})
    if (warning.find(text) != std::string_view::npos) return true;
  return false;
}

Status decode_with(tjhandle turbo, JpegBytes b, const JpegHeader& header, ImageRgb& out) {
  int width = 0, height = 0, subsampling = 0, space = 0;
  // Its result does not matter here: it refuses subsamplings that are decoded below.
  static_cast<void>(
      tjDecompressHeader3(turbo, b.data(), b.size(), &width, &height, &subsampling, &space));
  if (width != static_cast<int>(header.width) || height != static_cast<int>(header.height))
    return corrupt_jpeg("the picture has another size than its header says");
  out.width = width, out.height = height;
  out.data.resize(static_cast<std::size_t>(width) * height * ImageRgb::kChannels);
  if (tjDecompress2(turbo, b.data(), b.size(), out.data.data(), width, width * ImageRgb::kChannels,
                    height, TJPF_RGB, TJFLAG_LIMITSCANS) == 0)
    return {};
  const std::string reason = tjGetErrorStr2(turbo);
  if (tjGetErrorCode(turbo) == TJERR_WARNING && is_harmless(reason)) return {};
  const bool cut = reason.find("remature end") != std::string::npos;
  return corrupt_jpeg((cut ? "JPEG is truncated: " : "the picture cannot be decoded: ") + reason);
}

}  // namespace

bool is_jpeg(std::span<const std::byte> bytes) {
  return starts_jpeg({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

Result<PictureHeader> read_jpeg_header(std::span<const std::byte> bytes) {
  const JpegBytes b(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  if (!starts_jpeg(b)) return Error{Error::Cause::unsupported, "not a JPEG"};
  const auto header = check_jpeg(b);
  if (!header) return header.error();
  return PictureHeader{static_cast<int>(header->width), static_cast<int>(header->height), 8,
                       header->channels == 1};
}

Status decode_jpeg(std::span<const std::byte> bytes, ImageRgb& out) {
  if (bytes.size() > kMaxJpegBytes)
    return Error{Error::Cause::too_large, "a coded picture of over 2 GiB"};
  const JpegBytes b(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  if (!starts_jpeg(b)) return Error{Error::Cause::unsupported, "not a JPEG"};
  const auto header = check_jpeg(b);
  if (!header) return header.error();
  thread_local TurboJpeg turbo;
  if (turbo == nullptr) turbo.reset(tjInitDecompress());
  if (turbo == nullptr) return Error{Error::Cause::io, "no room for a JPEG decoder"};
  const auto done = decode_with(turbo.get(), b, *header, out);
  if (!done) turbo.reset();  // tjDecompressHeader3() leaves its picture half read after an error
  return done;
}

Result<ImageRgb> decode_jpeg(std::span<const std::byte> bytes) {
  ImageRgb image;
  if (const auto done = decode_jpeg(bytes, image); !done) return done.error();
  return image;
}

}  // namespace mr::kit
