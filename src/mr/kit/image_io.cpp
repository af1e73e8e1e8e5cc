#include "mr/kit/image_io.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "mr/core/file.h"
#include "mr/kit/image_limits.h"
#include "mr/kit/jpeg.h"

namespace mr::kit {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{512} << 20;
constexpr std::size_t kMaxBytesInMemory = 0x7FFFFFFF;  // OpenCV counts them in an int

/// What a file's header claims, read without decoding.
struct Header {
  std::uint64_t width = 0, height = 0;
  int bits = 8;       ///< per channel
  bool grey = false;  ///< one channel without palette or alpha
};

Error corrupt(std::string what) { return {Error::Cause::corrupt, std::move(what)}; }

std::uint32_t big16(Bytes b, std::size_t at) { return b[at] << 8 | b[at + 1]; }
std::uint32_t big32(Bytes b, std::size_t at) { return big16(b, at) << 16 | big16(b, at + 2); }

// --- PNG: every chunk must be whole and carry its right checksum up to IEND.

constexpr std::array<std::uint8_t, 8> kPngSignature{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};

bool is_png(Bytes b) {
  return b.size() >= kPngSignature.size() &&
         std::equal(kPngSignature.begin(), kPngSignature.end(), b.begin());
}

constexpr std::array<std::uint32_t, 256> make_crc_table() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t c = i;
    for (int k = 0; k < 8; ++k) c = (c & 1) != 0 ? 0xEDB88320u ^ (c >> 1) : c >> 1;
    table[i] = c;
  }
  return table;
}

std::uint32_t crc32(Bytes b) {
  static constexpr auto kTable = make_crc_table();
  std::uint32_t c = 0xFFFFFFFFu;
  for (const std::uint8_t v : b) c = kTable[(c ^ v) & 0xFF] ^ (c >> 8);
  return ~c;
}

Result<Header> check_png(Bytes b) {
  std::optional<Header> header;
  bool has_data = false;
  for (std::size_t at = kPngSignature.size(); at + 12 <= b.size();) {
    const std::size_t length = big32(b, at);
    if (length > b.size() - at - 12) break;
    const std::string_view type(reinterpret_cast<const char*>(&b[at + 4]), 4);
    if (crc32(b.subspan(at + 4, length + 4)) != big32(b, at + 8 + length))
      return corrupt("PNG checksum is wrong");
    if (!header) {
      if (type != "IHDR" || length != 13) return corrupt("PNG does not start with its header");
      header = Header{big32(b, at + 8), big32(b, at + 12), b[at + 16], b[at + 17] == 0};
      if (const auto fits = within_image_limits(header->width, header->height); !fits)
        return fits.error();
    }
    if (type == "IDAT") has_data = true;
    if (type == "IEND") {
      if (!has_data) return corrupt("PNG without a picture");
      return *header;
    }
    at += 12 + length;
  }
  return corrupt("PNG is truncated");
}

// --- PGM: parsed here, so that the byte order is beyond doubt.

bool is_pgm(Bytes b) { return b.size() >= 3 && b[0] == 'P' && b[1] == '5'; }

bool is_space(std::uint8_t c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

/// Skips white space and comments, then reads a number of at most 9 digits.
std::optional<std::uint64_t> pgm_number(Bytes b, std::size_t& at) {
  while (at < b.size() && (is_space(b[at]) || b[at] == '#')) {
    if (b[at] == '#')
      while (at < b.size() && b[at] != '\n') ++at;
    else
      ++at;
  }
  std::uint64_t value = 0;
  const std::size_t first = at;
  for (; at < b.size() && b[at] >= '0' && b[at] <= '9'; ++at) {
    if (at - first >= 9) return std::nullopt;
    value = value * 10 + (b[at] - '0');
  }
  if (at == first) return std::nullopt;
  return value;
}

const Error kNotSixteenBit{Error::Cause::unsupported, "depth must be 16-bit grey"};

Result<ImageDepth16> decode_pgm(Bytes b) {
  std::size_t at = 2;
  const auto width = pgm_number(b, at), height = pgm_number(b, at), maxval = pgm_number(b, at);
  if (!width || !height || !maxval || at >= b.size() || !is_space(b[at]))
    return corrupt("PGM header is wrong");
  ++at;
  if (const auto fits = within_image_limits(*width, *height); !fits) return fits.error();
  if (*maxval == 0 || *maxval > 65535) return corrupt("PGM maxval must be 1 to 65535");
  if (*maxval < 256) return kNotSixteenBit;
  const std::size_t expected = *width * *height * 2, found = b.size() - at;
  if (found != expected)
    return corrupt(std::string(found < expected ? "PGM is truncated: " : "PGM is too long: ") +
                   std::to_string(found) + " bytes of pixels instead of " +
                   std::to_string(expected));
  ImageDepth16 image(static_cast<int>(*width), static_cast<int>(*height));
  for (std::size_t i = 0; i < image.data.size(); ++i)
    image.data[i] = static_cast<std::uint16_t>(big16(b, at + 2 * i));
  return image;
}

// --- decoding

Result<cv::Mat> decode(Bytes b, const Header& header, int flags) {
  try {
    // imdecode() wants a matrix that it may write to, and only reads.
    const cv::Mat input(1, static_cast<int>(b.size()), CV_8UC1,
                        const_cast<std::uint8_t*>(b.data()));
    cv::Mat picture = cv::imdecode(input, flags);
    if (picture.empty()) return corrupt("the picture cannot be decoded");
    if (static_cast<std::uint64_t>(picture.cols) != header.width ||
        static_cast<std::uint64_t>(picture.rows) != header.height)
      return corrupt("the picture has another size than its header says");
    return picture;
  } catch (const std::exception& e) {  // cv::Exception, std::bad_alloc
    return corrupt(std::string("the picture cannot be decoded: ") + e.what());
  }
}

Result<PictureHeader> decode_header(Bytes b) {
  if (is_jpeg(std::as_bytes(b))) return read_jpeg_header(std::as_bytes(b));
  if (!is_png(b)) return Error{Error::Cause::unsupported, "neither JPEG nor PNG"};
  const auto header = check_png(b);
  if (!header) return header.error();
  return PictureHeader{static_cast<int>(header->width), static_cast<int>(header->height),
                       header->bits, header->grey};
}

Result<ImageRgb> decode_jpeg_or_png(Bytes b) {
  if (is_jpeg(std::as_bytes(b))) return decode_jpeg(std::as_bytes(b));
  if (!is_png(b)) return Error{Error::Cause::unsupported, "neither JPEG nor PNG"};
  const auto header = check_png(b);
  if (!header) return header.error();
  // A camera's pixels are wanted as they were taken: EXIF must not turn them.
  auto bgr = decode(b, *header, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  if (!bgr) return bgr.error();
  ImageRgb image(bgr->cols, bgr->rows);
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* from = bgr->ptr<std::uint8_t>(y);
    std::uint8_t* to = image.row(y);
    for (int x = 0; x < image.width; ++x, from += 3, to += 3)
      to[0] = from[2], to[1] = from[1], to[2] = from[0];
  }
  return image;
}

Result<ImageDepth16> decode_depth(Bytes b) {
  if (is_pgm(b)) return decode_pgm(b);
  if (is_jpeg(std::as_bytes(b))) return kNotSixteenBit;
  if (!is_png(b)) return Error{Error::Cause::unsupported, "neither PNG nor PGM (P5)"};
  const auto header = check_png(b);
  if (!header) return header.error();
  if (header->bits != 16 || !header->grey) return kNotSixteenBit;
  auto grey = decode(b, *header, cv::IMREAD_UNCHANGED);
  if (!grey) return grey.error();
  if (grey->type() != CV_16UC1) return kNotSixteenBit;
  ImageDepth16 image(grey->cols, grey->rows);
  for (int y = 0; y < image.height; ++y)
    std::copy_n(grey->ptr<std::uint16_t>(y), image.width, image.row(y));
  return image;
}

/// Reads a file and decodes it; errors of the decoder get the file's name.
template <typename T>
Result<T> read_with(Result<T> (*decoder)(Bytes), const std::filesystem::path& file) {
  const auto bytes = read_file(file, kMaxFileBytes);
  if (!bytes) return bytes.error();
  auto image = decoder({reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size()});
  if (!image) return Error{image.error().cause, file.string() + ": " + image.error().message};
  return image;
}

Result<std::vector<std::byte>> encode(const ImageRgb& image, const char* extension,
                                      const std::vector<int>& parameters) {
  if (image.empty()) return Error{Error::Cause::empty, "there is no picture to encode"};
  cv::Mat bgr(image.height, image.width, CV_8UC3);
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* from = image.row(y);
    std::uint8_t* to = bgr.ptr<std::uint8_t>(y);
    for (int x = 0; x < image.width; ++x, from += 3, to += 3)
      to[0] = from[2], to[1] = from[1], to[2] = from[0];
  }
  try {
    std::vector<std::uint8_t> coded;
    if (!cv::imencode(extension, bgr, coded, parameters))
      return Error{Error::Cause::unsupported, std::string("cannot encode ") + extension};
    std::vector<std::byte> bytes(coded.size());
    std::memcpy(bytes.data(), coded.data(), coded.size());
    return bytes;
  } catch (const std::exception& e) {
    return Error{Error::Cause::unsupported, std::string("cannot encode a picture: ") + e.what()};
  }
}

}  // namespace

Result<PictureHeader> read_picture_header(const std::filesystem::path& file) {
  return read_with(&decode_header, file);
}

Result<ImageRgb> read_color(const std::filesystem::path& file) {
  return read_with(&decode_jpeg_or_png, file);
}

Result<ImageRgb> decode_color(std::span<const std::byte> bytes) {
  if (bytes.size() > kMaxBytesInMemory)
    return Error{Error::Cause::too_large, "a coded picture of over 2 GiB"};
  return decode_jpeg_or_png({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

Result<ImageDepth16> read_depth16(const std::filesystem::path& file) {
  return read_with(&decode_depth, file);
}

Result<std::vector<std::byte>> encode_png(const ImageRgb& image) {
  return encode(image, ".png", {});
}

Result<std::vector<std::byte>> encode_jpeg(const ImageRgb& image, int quality) {
  return encode(image, ".jpg", {cv::IMWRITE_JPEG_QUALITY, std::clamp(quality, 1, 100)});
}

Status write_png(const std::filesystem::path& file, const ImageRgb& image) {
  const auto bytes = encode_png(image);
  if (!bytes) return Error{bytes.error().cause, file.string() + ": " + bytes.error().message};
  return write_file(file, *bytes);
}

}  // namespace mr::kit
