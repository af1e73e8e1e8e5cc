#include "mr/synth/mkv_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "mr/kit/image_io.h"

namespace mr::synth {
namespace {

struct Ycc {
  double y, cb, cr;
};

double luma_601(const std::uint8_t* rgb) {
  return 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
}

/// The mean of pixels side by side, or of 2x2.
Ycc chroma_of(const ImageRgb& picture, int x, int y, int rows) {
  double rgb[3] = {};
  for (int dy = 0; dy < rows; ++dy)
    for (int dx = 0; dx < 2; ++dx)
      for (int c = 0; c < 3; ++c) rgb[c] += picture.at(x + dx, y + dy)[c] / (2.0 * rows);
  const double luma = 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
  return {luma, (rgb[2] - luma) / 1.772, (rgb[0] - luma) / 1.402};
}

std::byte luma_byte(double luma) { return static_cast<std::byte>(16.5 + luma * 219 / 255); }
std::byte chroma_byte(double chroma) { return static_cast<std::byte>(128.5 + chroma * 224 / 255); }

std::vector<std::byte> nv12_of(const ImageRgb& picture) {
  std::vector<std::byte> out;
  for (std::size_t i = 0; i < picture.data.size(); i += 3)
    out.push_back(luma_byte(luma_601(&picture.data[i])));
  for (int y = 0; y < picture.height; y += 2)
    for (int x = 0; x < picture.width; x += 2) {
      const Ycc c = chroma_of(picture, x, y, 2);
      out.push_back(chroma_byte(c.cb));
      out.push_back(chroma_byte(c.cr));
    }
  return out;
}

std::vector<std::byte> yuy2_of(const ImageRgb& picture) {
  std::vector<std::byte> out;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; x += 2) {
      const Ycc c = chroma_of(picture, x, y, 1);
      out.push_back(luma_byte(luma_601(picture.at(x, y))));
      out.push_back(chroma_byte(c.cb));
      out.push_back(luma_byte(luma_601(picture.at(x + 1, y))));
      out.push_back(chroma_byte(c.cr));
    }
  return out;
}

std::vector<std::byte> bgra_of(const ImageRgb& picture) {
  std::vector<std::byte> out;
  for (std::size_t i = 0; i < picture.data.size(); i += 3) {
    for (const std::size_t c : {2, 1, 0}) out.push_back(std::byte{picture.data[i + c]});
    out.push_back(std::byte{255});
  }
  return out;
}

void put_count(std::vector<std::byte>& out, double count) {
  const auto v = static_cast<std::uint16_t>(std::clamp(std::lround(count), 0l, 65535l));
  out.push_back(static_cast<std::byte>(v >> 8));
  out.push_back(static_cast<std::byte>(v));
}

}  // namespace

Result<std::vector<std::byte>> mkv_color(const ImageRgb& picture, MkvColor format,
                                         int jpeg_quality) {
  MR_ASSERT(picture.width % 2 == 0 && picture.height % 2 == 0);
  switch (format) {
    case MkvColor::mjpg:
      return kit::encode_jpeg(picture, jpeg_quality);
    case MkvColor::nv12:
      return nv12_of(picture);
    case MkvColor::yuy2:
      return yuy2_of(picture);
    case MkvColor::bgra:
      break;
  }
  return bgra_of(picture);
}

std::vector<std::byte> mkv_depth(const ImageDepth& depth) {
  std::vector<std::byte> out;
  out.reserve(2 * depth.data.size());
  for (const float metres : depth.data) put_count(out, metres * 1000);
  return out;
}

std::vector<std::byte> mkv_infrared(const ImageDepth& depth, const Camera& depth_camera,
                                    const ImageRgb& color, const Camera& color_camera,
                                    const Pose& T_color_depth) {
  constexpr double kAtOneMetre = 10, kUnseen = 100;  // counts per level of brightness; levels
  std::vector<std::byte> out;
  out.reserve(2 * depth.data.size());
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      const double z = *depth.at(x, y);
      if (z <= 0) {
        put_count(out, 0);
        continue;
      }
      const Vec3d point = z * unproject(depth_camera, {double(x), double(y)});
      const auto at = project(color_camera, T_color_depth * point);
      const int u = at ? static_cast<int>(std::lround(at->x)) : -1;
      const int v = at ? static_cast<int>(std::lround(at->y)) : -1;
      const double level = color.contains(u, v) ? luma_601(color.at(u, v)) : kUnseen;
      put_count(out, kAtOneMetre * level / (z * z));
    }
  return out;
}

}  // namespace mr::synth
