#include "mr/baseline/depth_video.h"

#include <gtest/gtest.h>

#include <cmath>

#include "mr/kit/video.h"

namespace mr {
namespace {

constexpr baseline::DepthRange kRange{0.3, 5};

/// A slope from the lower left, near, to the upper right, far.
ImageDepth slope(int width, int height, double near_m, double far_m) {
  ImageDepth depth(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      *depth.at(x, y) = static_cast<float>(near_m + (far_m - near_m) * (x + height - 1.0 - y) /
                                                        (width + height - 2.0));
  return depth;
}

ImageDepth coded(const ImageDepth& depth, int qp, std::size_t* bytes = nullptr) {
  const ImageRgb picture = baseline::depth_to_picture(depth, kRange);
  auto encoder = *kit::VideoEncoder::create({picture.width, picture.height, 30, qp, 1, 1});
  auto decoder = *kit::VideoDecoder::create();
  const auto unit = *encoder.encode(picture, true);
  if (bytes) *bytes = unit.data.size();
  return baseline::picture_to_depth(*decoder.decode(unit.data), depth.width, depth.height, kRange);
}

struct Difference {
  double rms_m = 0, worst_m = 0;
  double off = 0, lost = 0;  ///< shares of the valid pixels: off by over a centimetre, invalid
  int made_up = 0;           ///< pixels that were not valid before
};
Difference compare(const ImageDepth& a, const ImageDepth& b) {
  Difference out;
  double sum = 0, valid = 0, lost = 0, wrong = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    out.made_up += a.data[i] <= 0 && b.data[i] > 0;
    if (a.data[i] <= 0) continue;
    ++valid;
    lost += b.data[i] <= 0;
    if (b.data[i] <= 0) continue;
    const double off = std::abs(a.data[i] - b.data[i]);
    wrong += off > 0.01;
    sum += off * off, out.worst_m = std::max(out.worst_m, off);
  }
  out.rms_m = std::sqrt(sum / std::max(1.0, valid - lost));
  out.lost = lost / valid, out.off = wrong / valid;
  return out;
}

/// Where the wave turns, depth may be folded to the wrong side, by half a step at most.
TEST(DepthVideo, WithoutCodingAMillimetreIsKept) {
  const ImageDepth depth = slope(320, 288, 0.3, 5);
  const Difference d = compare(
      depth,
      baseline::picture_to_depth(baseline::depth_to_picture(depth, kRange), 320, 288, kRange));
  EXPECT_LT(d.rms_m, 0.0012);
  EXPECT_LT(d.worst_m, 0.013);
  EXPECT_EQ(d.off, 0);
  EXPECT_EQ(d.lost, 0);
}

TEST(DepthVideo, APlaneKeepsItsPlaceThroughVideo) {
  for (const int qp : {1, 14, 24}) {
    SCOPED_TRACE(qp);
    const ImageDepth depth = slope(320, 288, 1.2, 3.1);
    const Difference d = compare(depth, coded(depth, qp));
    EXPECT_LT(d.rms_m, qp > 14 ? 0.005 : 0.002);
    EXPECT_LT(d.off, qp > 14 ? 0.03 : 0.01);
    EXPECT_LT(d.worst_m, 0.1);
    EXPECT_LT(d.lost, 0.01);
  }
}

TEST(DepthVideo, WhatIsInvalidStaysSoAndEdgesAreNotSmeared) {
  ImageDepth depth = slope(320, 288, 1.0, 1.3);
  for (int y = 60; y < 180; ++y)
    for (int x = 80; x < 200; ++x) *depth.at(x, y) = 3.2f;
  for (int y = 200; y < 260; ++y)
    for (int x = 100; x < 250; ++x) *depth.at(x, y) = 0;
  const ImageDepth got = coded(depth, 14);
  const Difference d = compare(depth, got);
  EXPECT_EQ(d.made_up, 0);
  EXPECT_LT(d.lost, 0.02);
  for (const float z : got.data)
    EXPECT_TRUE(z == 0 || (z > 0.98f && z < 1.32f) || (z > 3.18f && z < 3.22f)) << z;
  ImageDepth nothing(320, 288);
  EXPECT_EQ(coded(nothing, 14), nothing);
}

}  // namespace
}  // namespace mr
