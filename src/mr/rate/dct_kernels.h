#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "mr/core/packet.h"

/// The inner loops of features (rate/features.h), compiled for several instruction sets and chosen
/// at run time (Highway; core/simd.h). All arithmetic is in single IEEE operations in a fixed
/// order, without fused multiply-add: every set gives the same bytes.
namespace mr::rate {

inline constexpr int kFeatureBlock = 32;  ///< edge of a block, pixels

/// The DCT-II of a block, not normalised: [i][j] is the sum over pixels of
///   (pixel - first pixel) cos(π (2 x + 1) i / 64) cos(π (2 y + 1) j / 64)
/// A constant changes only [0][0], which does not count. Without the first pixel, a large one adds
/// no rounding error to the others.
struct alignas(64) DctBlock {
  std::array<float, kFeatureBlock * kFeatureBlock> values{};
};

struct BlockFeatures {
  float spatial = 0;                  ///< DCT energy (rate/features.h)
  float temporal = 0;                 ///< DCT energy of the difference to the block before
  float first = 0;                    ///< the first pixel
  float sum = 0, sum_of_squares = 0;  ///< over pixels, of pixel - first pixel
};

/// Of the block whose first pixel is at `pixels`; rows are `stride` floats apart. `dct`: in, that
/// of the block before; out, that of this one.
BlockFeatures block_features(const float* pixels, std::ptrdiff_t stride, DctBlock& dct);

/// BT.709 luma 0..255 of a row of `width` pixels, R G B.
void luma_row(const std::uint8_t* rgb, int width, float* luma);

inline constexpr float kFarthest_m = 1e5f;
/// Whether a depth is a measurement; not: 0, NaN, negative.
inline bool is_measured(float depth_m) { return depth_m > 0 && depth_m < kFarthest_m; }

/// Depth of a row in millimetres. Pixels without a measurement take that of their left neighbour,
/// the first ones `before_m`.
void depth_row(const float* depth_m, int width, float before_m, float* depth_mm);

struct DepthChange {
  std::size_t measured = 0;  ///< pixels that are measured now and were before
  std::size_t moved = 0;     ///< those of them that differ by more than noise
};

/// Compares a row of depths in metres to the row before, and replaces that. More than noise:
/// `sigmas` standard deviations of `precision` at the farther depth.
DepthChange replace_depth_row(const float* depth_m, int width, const Precision& precision,
                              double sigmas, float* before_m);

}  // namespace mr::rate
