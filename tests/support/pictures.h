#pragma once

#include <cstdint>
#include <string>

#include "mr/core/image.h"

/// Picture files made byte by byte, independent of the decoders under test.
namespace mr::test {

inline std::string big_endian(std::uint32_t v, int bytes) {
  std::string out;
  for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8)
    out += static_cast<char>(v >> shift & 0xFF);
  return out;
}

inline std::uint32_t png_crc(const std::string& bytes) {
  std::uint32_t c = 0xFFFFFFFFu;
  for (const char byte : bytes) {
    c ^= static_cast<std::uint8_t>(byte);
    for (int k = 0; k < 8; ++k) c = (c & 1) != 0 ? 0xEDB88320u ^ (c >> 1) : c >> 1;
  }
  return ~c;
}

inline std::string png_chunk(const std::string& type, const std::string& data) {
  return big_endian(static_cast<std::uint32_t>(data.size()), 4) + type + data +
         big_endian(png_crc(type + data), 4);
}

/// zlib stream of stored blocks: not compressed.
inline std::string zlib_stored(const std::string& data) {
  std::string out("\x78\x01", 2);
  std::uint32_t a = 1, b = 0;
  for (const char c : data) a = (a + static_cast<std::uint8_t>(c)) % 65521, b = (b + a) % 65521;
  for (std::size_t at = 0; at < data.size(); at += 65535) {
    const std::string block = data.substr(at, 65535);
    const auto n = static_cast<std::uint32_t>(block.size());
    out += at + 65535 >= data.size() ? '\x01' : '\0';
    for (const std::uint32_t v : {n, ~n})
      out += {static_cast<char>(v & 0xFF), static_cast<char>(v >> 8 & 0xFF)};
    out += block;
  }
  return out + big_endian(b << 16 | a, 4);
}

/// A PNG that claims a size and holds `rows` (filter bytes included).
inline std::string png_file(std::uint32_t width, std::uint32_t height, int bits, int color_type,
                            const std::string& rows) {
  const std::string header = big_endian(width, 4) + big_endian(height, 4) +
                             static_cast<char>(bits) + static_cast<char>(color_type) +
                             std::string(3, '\0');
  return std::string("\x89PNG\r\n\x1A\n", 8) + png_chunk("IHDR", header) +
         png_chunk("IDAT", zlib_stored(rows)) + png_chunk("IEND", "");
}

inline std::string depth_png(const Image<std::uint16_t, 1>& image) {
  std::string rows;
  for (int y = 0; y < image.height; ++y) {
    rows += '\0';
    for (int x = 0; x < image.width; ++x) rows += big_endian(*image.at(x, y), 2);
  }
  return png_file(image.width, image.height, 16, 0, rows);
}

inline std::string depth_pgm(const Image<std::uint16_t, 1>& image) {
  std::string out = "P5\n# made by a test\n" + std::to_string(image.width) + " " +
                    std::to_string(image.height) + "\n65535\n";
  for (const std::uint16_t v : image.data) out += big_endian(v, 2);
  return out;
}

/// Counts 1, 2, 3, … with both bytes in use.
inline Image<std::uint16_t, 1> counting_depth(int width, int height) {
  Image<std::uint16_t, 1> image(width, height);
  for (std::size_t i = 0; i < image.data.size(); ++i)
    image.data[i] = static_cast<std::uint16_t>(500 + 13 * i);
  return image;
}

/// Red grows to the right, green downwards; blue is 200.
inline ImageRgb gradient(int width, int height) {
  ImageRgb image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      image.at(x, y)[0] = static_cast<std::uint8_t>(255 * x / width);
      image.at(x, y)[1] = static_cast<std::uint8_t>(255 * y / height);
      image.at(x, y)[2] = 200;
    }
  return image;
}

}  // namespace mr::test
