#include "mr/kit/panorama_info.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <numbers>
#include <optional>
#include <string_view>
#include <utility>

#include "mr/kit/image_limits.h"

namespace mr::kit {
namespace {

constexpr std::string_view kXmpHeader("http://ns.adobe.com/xap/1.0/\0", 29);
constexpr double kMostDegrees = 360, kMostPixels = 1 << 20;
constexpr std::size_t kLongestValue = 40;

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

/// The XMP packet of a JPEG; empty where there is none.
std::string_view xmp_packet(std::span<const std::byte> jpeg) {
  const std::string_view b(reinterpret_cast<const char*>(jpeg.data()), jpeg.size());
  const auto byte = [&](std::size_t at) { return static_cast<std::uint8_t>(b[at]); };
  if (!b.starts_with("\xFF\xD8")) return {};
  for (std::size_t at = 2; at + 4 <= b.size() && byte(at) == 0xFF;) {
    const std::uint8_t marker = byte(at + 1);
    if (marker == 0xFF) {  // padding
      ++at;
      continue;
    }
    if (marker == 0xDA || marker == 0xD9) break;
    const std::size_t length = byte(at + 2) << 8 | byte(at + 3);
    if (length < 2 || at + 2 + length > b.size()) break;
    const std::string_view body = b.substr(at + 4, length - 2);
    if (marker == 0xE1 && body.starts_with(kXmpHeader)) return body.substr(kXmpHeader.size());
    at += 2 + length;
  }
  return {};
}

/// The value of GPano:NAME="value" or <GPano:NAME>value</GPano:NAME>.
std::optional<std::string_view> gpano_value(std::string_view xmp, std::string_view name) {
  const std::string key = "GPano:" + std::string(name);
  for (std::size_t at = xmp.find(key); at != std::string_view::npos; at = xmp.find(key, at + 1)) {
    std::string_view rest = xmp.substr(at + key.size());
    char end = '<';
    if (!rest.starts_with('>')) {
      rest = trimmed(rest.substr(0, kLongestValue * 2));
      if (!rest.starts_with('=')) continue;
      rest = trimmed(rest.substr(1));
      if (rest.empty() || (rest[0] != '"' && rest[0] != '\'')) continue;
      end = rest[0];
    }
    const std::string_view value = rest.substr(1, kLongestValue);
    if (const auto length = value.find(end); length != std::string_view::npos)
      return trimmed(value.substr(0, length));
  }
  return std::nullopt;
}

/// Sets `out` where the field is there; an error where it is no number or too large.
template <typename Number>
Status read_number(std::string_view xmp, std::string_view name, double most, Number& out) {
  const auto text = gpano_value(xmp, name);
  if (!text) return {};
  std::string_view digits = *text;
  if (digits.starts_with('+')) digits.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size() || !(std::abs(value) <= most))
    return Error{Error::Cause::corrupt, "XMP field GPano:" + std::string(name) +
                                            " must be a number of at most " +
                                            std::to_string(static_cast<int>(most))};
  out = static_cast<Number>(value);
  return {};
}

Status read_crop(std::string_view xmp, PanoramaInfo& info) {
  PanoramaInfo read;
  for (const auto& [name, field] :
       {std::pair<std::string_view, int*>{"FullPanoWidthPixels", &read.full_width},
        {"FullPanoHeightPixels", &read.full_height},
        {"CroppedAreaImageWidthPixels", &read.crop.width},
        {"CroppedAreaImageHeightPixels", &read.crop.height},
        {"CroppedAreaLeftPixels", &read.crop.x},
        {"CroppedAreaTopPixels", &read.crop.y}})
    if (const auto status = read_number(xmp, name, kMostPixels, *field); !status) return status;
  const Rect whole{0, 0, read.full_width, read.full_height};
  if (read.full_width <= 0 || read.full_height <= 0 || read.crop.empty() || read.crop == whole)
    return {};
  info.full_width = read.full_width, info.full_height = read.full_height, info.crop = read.crop;
  return {};
}

Mat3 about_x(double rad) {
  const double c = std::cos(rad), s = std::sin(rad);
  return {{1, 0, 0, 0, c, -s, 0, s, c}};
}
Mat3 about_y(double rad) {
  const double c = std::cos(rad), s = std::sin(rad);
  return {{c, 0, s, 0, 1, 0, -s, 0, c}};
}
Mat3 about_z(double rad) {
  const double c = std::cos(rad), s = std::sin(rad);
  return {{c, -s, 0, s, c, 0, 0, 0, 1}};
}

std::string size_text(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

bool lies_within(const Rect& r, int width, int height) {
  return !r.empty() && r.x >= 0 && r.y >= 0 && r.width <= width && r.height <= height &&
         r.x <= width - r.width && r.y <= height - r.height;
}

/// The sphere and the crop at the scale of a picture that is `width` x `height`.
PanoramaInfo scaled_to(const PanoramaInfo& info, int width, int height) {
  const double across = static_cast<double>(width) / info.crop.width;
  const double down = static_cast<double>(height) / info.crop.height;
  const auto scaled = [](int value, double by) {
    return static_cast<int>(std::lround(value * by));
  };
  PanoramaInfo out = info;
  out.full_width = scaled(info.full_width, across);
  out.full_height = scaled(info.full_height, down);
  out.crop = {scaled(info.crop.x, across), scaled(info.crop.y, down), width, height};
  out.crop.x = std::min(out.crop.x, out.full_width - width);
  out.crop.y = std::min(out.crop.y, out.full_height - height);
  return out;
}

}  // namespace

bool is_2_to_1(int width, int height) {
  return height > 0 && width > 0 && std::abs(std::int64_t{width} - 2 * std::int64_t{height}) <= 2;
}

Result<PanoramaInfo> read_panorama_info(std::span<const std::byte> jpeg) {
  const std::string_view xmp = xmp_packet(jpeg);
  PanoramaInfo info;
  const auto projection = gpano_value(xmp, "ProjectionType");
  if (!projection) return info;
  info.projection = *projection;
  if (!std::all_of(info.projection.begin(), info.projection.end(),
                   [](char c) { return c > ' ' && c < 127; }))
    return Error{Error::Cause::corrupt, "XMP field GPano:ProjectionType must be one word"};
  for (const auto& [name, field] :
       {std::pair<std::string_view, double*>{"PoseHeadingDegrees", &info.heading_deg},
        {"PosePitchDegrees", &info.pitch_deg},
        {"PoseRollDegrees", &info.roll_deg}})
    if (const auto status = read_number(xmp, name, kMostDegrees, *field); !status)
      return status.error();
  if (const auto status = read_crop(xmp, info); !status) return status.error();
  return info;
}

Pose T_upright_picture(const PanoramaInfo& info) {
  constexpr double kRad = std::numbers::pi / 180;
  // With y down, turning right is a rotation about y, looking up one about x, and a lowered right
  // side one about z: all by the right-hand rule.
  return {about_y(info.heading_deg * kRad) * about_x(info.pitch_deg * kRad) *
              about_z(info.roll_deg * kRad),
          {}};
}

Result<ImageRgb> uncropped(ImageRgb image, const PanoramaInfo& info) {
  if (!info.cropped()) return image;
  const Rect& c = info.crop;
  if (image.empty() || !lies_within(c, info.full_width, info.full_height) ||
      !is_2_to_1(info.full_width, info.full_height))
    return Error{Error::Cause::corrupt,
                 "a part of " + size_text(c.width, c.height) + " pixels at " + std::to_string(c.x) +
                     ", " + std::to_string(c.y) + " does not fit a 2:1 panorama of " +
                     size_text(info.full_width, info.full_height)};
  const double skew =
      (static_cast<double>(image.width) / c.width) / (static_cast<double>(image.height) / c.height);
  constexpr double kMostSkew = 0.02;
  if (std::abs(skew - 1) > kMostSkew)
    return Error{Error::Cause::corrupt, "a picture of " + size_text(image.width, image.height) +
                                            " pixels is not the part of " +
                                            size_text(c.width, c.height) + " that its XMP states"};
  const double full_width = static_cast<double>(info.full_width) * image.width / c.width;
  const double full_height = static_cast<double>(info.full_height) * image.height / c.height;
  constexpr double kCountable = 1e9;
  if (const auto fits =
          within_image_limits(static_cast<std::uint64_t>(std::min(full_width + 1, kCountable)),
                              static_cast<std::uint64_t>(std::min(full_height + 1, kCountable)));
      !fits)
    return fits.error();
  const PanoramaInfo at = scaled_to(info, image.width, image.height);
  ImageRgb out(at.full_width, at.full_height);
  for (int y = 0; y < image.height; ++y)
    std::copy_n(image.row(y), static_cast<std::size_t>(image.width) * 3,
                out.at(at.crop.x, at.crop.y + y));
  return out;
}

}  // namespace mr::kit
