#include "mr/kit/yuv.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "mr/core/simd.h"

namespace mr {
namespace {

/// Planes with their memory; rows are longer than the picture.
struct Planes {
  static constexpr int kBeyond = 5;
  int width, height;
  std::vector<std::uint8_t> y, cb, cr;

  Planes(int w, int h)
      : width(w),
        height(h),
        y((w + kBeyond) * h, 7),
        cb((columns() + kBeyond) * rows(), 7),
        cr(cb) {}
  int columns() const { return (width + 1) / 2; }
  int rows() const { return (height + 1) / 2; }
  template <typename Byte>
  kit::YuvPlanes<Byte> planes() {
    return {{y.data(), cb.data(), cr.data()},
            {width + kBeyond, columns() + kBeyond, columns() + kBeyond}};
  }
  int at(const std::vector<std::uint8_t>& plane, int x, int row) const {
    return plane[row * ((&plane == &y ? width : columns()) + kBeyond) + x];
  }
};

ImageRgb random_picture(int width, int height) {
  std::mt19937 random(7);
  ImageRgb out(width, height);
  for (std::uint8_t& v : out.data) v = static_cast<std::uint8_t>(random() % 256);
  return out;
}

/// ITU-R BT.709, 8 bits, limited range.
double luma(const double* rgb) {
  return 16 + 219.0 / 255 * (0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]);
}
double chroma(const double* rgb, int channel) {
  const double light = (luma(rgb) - 16) * 255 / 219;
  return 128 + 224.0 / 255 * (rgb[channel] - light) / (channel == 2 ? 1.8556 : 1.5748);
}

TEST(Yuv, IsBt709) {
  for (const int width : {2, 18, 34, 64, 98}) {
    const ImageRgb picture = random_picture(width, 6);
    Planes out(width, 6);
    kit::rgb_to_yuv(picture, out.planes<std::uint8_t>());
    for (int y = 0; y < 6; ++y)
      for (int x = 0; x < width; ++x) {
        const std::uint8_t* const p = picture.at(x, y);
        const double rgb[] = {double(p[0]), double(p[1]), double(p[2])};
        EXPECT_NEAR(out.at(out.y, x, y), luma(rgb), 0.6);
      }
    for (int y = 0; y < 3; ++y)
      for (int x = 0; x < width / 2; ++x) {
        double mean[3] = {};
        for (int i = 0; i < 4; ++i)
          for (int c = 0; c < 3; ++c) mean[c] += picture.at(2 * x + i % 2, 2 * y + i / 2)[c] / 4.0;
        EXPECT_NEAR(out.at(out.cb, x, y), chroma(mean, 2), 0.6);
        EXPECT_NEAR(out.at(out.cr, x, y), chroma(mean, 0), 0.6);
      }
    EXPECT_EQ(out.y[width], 7);  // nothing is written beyond the picture
    EXPECT_EQ(out.cb[width / 2], 7);
  }
}

TEST(Yuv, InterpolatesChroma) {
  std::mt19937 random(3);
  for (const auto& [width, height] : {std::pair(1, 1), {7, 5}, {33, 8}, {100, 3}}) {
    Planes in(width, height);
    for (auto* const plane : {&in.y, &in.cb, &in.cr})
      for (std::uint8_t& v : *plane) v = static_cast<std::uint8_t>(random() % 256);
    ImageRgb out(width, height);
    kit::yuv_to_rgb(in.planes<const std::uint8_t>(), out);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const auto between = [&](const std::vector<std::uint8_t>& plane) {
          const int x0 = x / 2, x1 = std::clamp(x0 + (x % 2 ? 1 : -1), 0, in.columns() - 1),
                    y0 = y / 2, y1 = std::clamp(y0 + (y % 2 ? 1 : -1), 0, in.rows() - 1);
          return (9 * in.at(plane, x0, y0) + 3 * in.at(plane, x1, y0) + 3 * in.at(plane, x0, y1) +
                  in.at(plane, x1, y1)) /
                     16.0 -
                 128;
        };
        const double light = (in.at(in.y, x, y) - 16) * 255 / 219.0;
        const double red = light + 1.5748 * 255 / 224 * between(in.cr);
        const double blue = light + 1.8556 * 255 / 224 * between(in.cb);
        const double green = (light - 0.2126 * red - 0.0722 * blue) / 0.7152;
        const double wanted[] = {red, green, blue};
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR(out.at(x, y)[c], std::clamp(wanted[c], 0.0, 255.0), 0.75);
      }
  }
}

TEST(Yuv, EveryInstructionSetGivesTheSameBytes) {
  const ImageRgb picture = random_picture(106, 40);
  Planes planes(106, 40);
  kit::rgb_to_yuv(picture, planes.planes<std::uint8_t>());
  ImageRgb back(106, 40);
  kit::yuv_to_rgb(planes.planes<const std::uint8_t>(), back);
  for (const std::string& target : simd_targets()) {
    ASSERT_TRUE(set_simd_target(target));
    Planes other(106, 40);
    kit::rgb_to_yuv(picture, other.planes<std::uint8_t>());
    EXPECT_EQ(other.y, planes.y) << target;
    EXPECT_EQ(other.cb, planes.cb) << target;
    EXPECT_EQ(other.cr, planes.cr) << target;
    ImageRgb other_back(106, 40);
    kit::yuv_to_rgb(planes.planes<const std::uint8_t>(), other_back);
    EXPECT_EQ(other_back, back) << target;
  }
  set_simd_target("");
}

}  // namespace
}  // namespace mr
