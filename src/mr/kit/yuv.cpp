#include "mr/kit/yuv.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/core/simd.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mr/kit/yuv.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h:
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace mr::kit::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// A factor below 1 in 32768ths.
constexpr std::int16_t fixed(double factor) {
  return static_cast<std::int16_t>(factor * 32768 + (factor < 0 ? -0.5 : 0.5));
}
constexpr double kLumaRange = 219.0 / 255, kChromaRange = 224.0 / 255;
constexpr double kRed = 0.2126, kGreen = 0.7152, kBlue = 0.0722;  // BT.709
constexpr int kMostLanes = 32;                                    // pixels at once

// 16-bit numbers, and how they are calculated with.
#if HWY_TARGET == HWY_SCALAR
using V16 = int;
HWY_INLINE int lanes() { return 2; }
HWY_INLINE V16 set(int v) { return v; }
HWY_INLINE V16 add(V16 a, V16 b) { return a + b; }
HWY_INLINE V16 sub(V16 a, V16 b) { return a - b; }
template <int kBits>
HWY_INLINE V16 left(V16 v) {
  return v * (1 << kBits);
}
template <int kBits>
HWY_INLINE V16 right(V16 v) {
  return v >> kBits;
}
HWY_INLINE V16 times(V16 v, double factor) { return (v * fixed(factor) + (1 << 14)) >> 15; }
HWY_INLINE V16 clamped(V16 v) { return std::clamp(v, 0, 255); }
#else
using D8 = hn::CappedTag<std::uint8_t, kMostLanes>;
using D16 = hn::RepartitionToWide<D8>;
using S16 = hn::RebindToSigned<D16>;
using V8 = hn::Vec<D8>;
using V16 = hn::Vec<S16>;
constexpr D8 d8;
constexpr D16 d16;
constexpr S16 s16;
HWY_INLINE int lanes() { return static_cast<int>(hn::Lanes(d8)); }
HWY_INLINE V16 set(int v) { return hn::Set(s16, static_cast<std::int16_t>(v)); }
HWY_INLINE V16 add(V16 a, V16 b) { return hn::Add(a, b); }
HWY_INLINE V16 sub(V16 a, V16 b) { return hn::Sub(a, b); }
template <int kBits>
HWY_INLINE V16 left(V16 v) {
  return hn::ShiftLeft<kBits>(v);
}
template <int kBits>
HWY_INLINE V16 right(V16 v) {
  return hn::ShiftRight<kBits>(v);
}
HWY_INLINE V16 times(V16 v, double factor) {
  return hn::MulFixedPoint15(v, hn::Set(s16, fixed(factor)));
}
HWY_INLINE V16 clamped(V16 v) { return hn::Min(hn::Max(v, hn::Zero(s16)), set(255)); }
#endif

/// Luma of a pixel.
HWY_INLINE V16 luma(V16 r, V16 g, V16 b) {
  const V16 sum =
      add(add(times(left<6>(r), kRed * kLumaRange), times(left<6>(g), kGreen * kLumaRange)),
          times(left<6>(b), kBlue * kLumaRange));
  return right<6>(add(sum, set(16 * 64 + 32)));
}

/// One channel of chroma of four pixels, from the sums of red, green and blue.
struct ChromaFactors {
  double red, green, blue;
};
constexpr double kPerBlue = 0.5 * kChromaRange / (1 - kBlue),
                 kPerRed = 0.5 * kChromaRange / (1 - kRed);
constexpr ChromaFactors kCb{-kRed * kPerBlue, -kGreen* kPerBlue, (1 - kBlue) * kPerBlue};
constexpr ChromaFactors kCr{(1 - kRed) * kPerRed, -kGreen* kPerRed, -kBlue* kPerRed};
HWY_INLINE V16 chroma(V16 r, V16 g, V16 b, const ChromaFactors& factors) {
  const V16 sum = add(add(times(left<4>(r), factors.red), times(left<4>(g), factors.green)),
                      times(left<4>(b), factors.blue));
  return right<6>(add(sum, set(128 * 64 + 32)));
}

struct Rgb {
  V16 r, g, b;
};

/// Of luma, and of chroma without its offset in 32nds. What is added up stays below 2^15: luma
/// gives at most 278 levels, chroma 271.
HWY_INLINE Rgb rgb_of(V16 y, V16 cb, V16 cr) {
  const V16 lifted = left<5>(sub(y, set(16)));
  const V16 light = add(add(lifted, times(lifted, 1 / kLumaRange - 1)), set(16));
  constexpr double kToRed = 2 * (1 - kRed) / kChromaRange, kToBlue = 2 * (1 - kBlue) / kChromaRange;
  const V16 red = add(cr, times(cr, kToRed - 1));
  const V16 blue = add(add(cb, cb), times(cb, kToBlue - 2));
  const V16 green = add(times(cr, kToRed * kRed / kGreen), times(cb, kToBlue * kBlue / kGreen));
  return {clamped(right<5>(add(light, red))), clamped(right<5>(sub(light, green))),
          clamped(right<5>(add(light, blue)))};
}

/// Chroma at a pixel: three parts of the nearer sample, one of that on its other side. The samples
/// are in 4ths, as they are mixed from two rows; the result is in 32nds, without its offset.
HWY_INLINE V16 between(V16 near, V16 beside) {
  return left<1>(sub(add(add(near, add(near, near)), beside), set(128 * 16)));
}

// As many pixels of a row, or of two, as there are lanes.
#if HWY_TARGET == HWY_SCALAR
HWY_INLINE void pixels_to_yuv(const std::uint8_t* above, const std::uint8_t* below,
                              std::uint8_t* y_above, std::uint8_t* y_below, std::uint8_t* u,
                              std::uint8_t* v) {
  int sum[3] = {};
  for (const auto& [rgb, y] : {std::pair(above, y_above), std::pair(below, y_below)})
    for (int x = 0; x < 2; ++x) {
      for (int c = 0; c < 3; ++c) sum[c] += rgb[3 * x + c];
      y[x] = static_cast<std::uint8_t>(luma(rgb[3 * x], rgb[3 * x + 1], rgb[3 * x + 2]));
    }
  *u = static_cast<std::uint8_t>(chroma(sum[0], sum[1], sum[2], kCb));
  *v = static_cast<std::uint8_t>(chroma(sum[0], sum[1], sum[2], kCr));
}

HWY_INLINE void pixels_to_rgb(const std::uint8_t* y, const std::int16_t* cb, const std::int16_t* cr,
                              std::uint8_t* rgb) {
  for (int x = 0; x < 2; ++x) {
    const int side = x == 0 ? -1 : 1;
    const Rgb out = rgb_of(y[x], between(cb[0], cb[side]), between(cr[0], cr[side]));
    for (const V16 channel : {out.r, out.g, out.b}) *rgb++ = static_cast<std::uint8_t>(channel);
  }
}
#else
HWY_INLINE V16 even(V8 v) {
  return hn::BitCast(s16, hn::And(hn::BitCast(d16, v), hn::Set(d16, std::uint16_t{255})));
}
HWY_INLINE V16 odd(V8 v) { return hn::BitCast(s16, hn::ShiftRight<8>(hn::BitCast(d16, v))); }

/// Bytes of two vectors of 0 .. 255, alternating.
HWY_INLINE V8 alternating(V16 even, V16 odd) { return hn::BitCast(d8, hn::Or(even, left<8>(odd))); }

/// Adds the pairs of each channel to the sums.
HWY_INLINE void luma_of_row(const std::uint8_t* rgb, std::uint8_t* y, Rgb& sums) {
  V8 r, g, b;
  hn::LoadInterleaved3(d8, rgb, r, g, b);
  hn::StoreU(alternating(luma(even(r), even(g), even(b)), luma(odd(r), odd(g), odd(b))), d8, y);
  sums = {add(sums.r, add(even(r), odd(r))), add(sums.g, add(even(g), odd(g))),
          add(sums.b, add(even(b), odd(b)))};
}

HWY_INLINE void pixels_to_yuv(const std::uint8_t* above, const std::uint8_t* below,
                              std::uint8_t* y_above, std::uint8_t* y_below, std::uint8_t* u,
                              std::uint8_t* v) {
  const hn::Rebind<std::uint8_t, S16> half;
  Rgb sums{set(0), set(0), set(0)};
  luma_of_row(above, y_above, sums);
  luma_of_row(below, y_below, sums);
  hn::StoreU(hn::DemoteTo(half, chroma(sums.r, sums.g, sums.b, kCb)), half, u);
  hn::StoreU(hn::DemoteTo(half, chroma(sums.r, sums.g, sums.b, kCr)), half, v);
}

HWY_INLINE void pixels_to_rgb(const std::uint8_t* y, const std::int16_t* cb, const std::int16_t* cr,
                              std::uint8_t* rgb) {
  const V8 luma = hn::LoadU(d8, y);
  const auto at = [](const std::int16_t* samples) HWY_ATTR { return hn::LoadU(s16, samples); };
  const Rgb first = rgb_of(even(luma), between(at(cb), at(cb - 1)), between(at(cr), at(cr - 1)));
  const Rgb second = rgb_of(odd(luma), between(at(cb), at(cb + 1)), between(at(cr), at(cr + 1)));
  hn::StoreInterleaved3(alternating(first.r, second.r), alternating(first.g, second.g),
                        alternating(first.b, second.b), d8, rgb);
}
#endif

/// Two rows of pixels.
void RowsToYuv(const std::uint8_t* above, const std::uint8_t* below, int width,
               std::uint8_t* y_above, std::uint8_t* y_below, std::uint8_t* u, std::uint8_t* v) {
  int x = 0;
  for (; x + lanes() <= width; x += lanes())
    pixels_to_yuv(above + 3 * x, below + 3 * x, y_above + x, y_below + x, u + x / 2, v + x / 2);
  if (x == width) return;
  const int rest = width - x;
  std::uint8_t rgb[2][3 * kMostLanes] = {}, y[2][kMostLanes], chroma[2][kMostLanes];
  std::copy_n(above + 3 * x, 3 * rest, rgb[0]);
  std::copy_n(below + 3 * x, 3 * rest, rgb[1]);
  pixels_to_yuv(rgb[0], rgb[1], y[0], y[1], chroma[0], chroma[1]);
  std::copy_n(y[0], rest, y_above + x), std::copy_n(y[1], rest, y_below + x);
  std::copy_n(chroma[0], rest / 2, u + x / 2), std::copy_n(chroma[1], rest / 2, v + x / 2);
}

/// One row of pixels. `cb`, `cr`: for two pixels each, in 4ths, with one more at both ends, and
/// room for kMostLanes more.
void RowToRgb(const std::uint8_t* y, const std::int16_t* cb, const std::int16_t* cr, int width,
              std::uint8_t* rgb) {
  int x = 0;
  for (; x + lanes() <= width; x += lanes())
    pixels_to_rgb(y + x, cb + x / 2, cr + x / 2, rgb + 3 * x);
  if (x == width) return;
  std::uint8_t last_y[kMostLanes] = {}, last_rgb[3 * kMostLanes];
  std::copy_n(y + x, width - x, last_y);
  pixels_to_rgb(last_y, cb + x / 2, cr + x / 2, last_rgb);
  std::copy_n(last_rgb, 3 * (width - x), rgb + 3 * x);
}

}  // namespace mr::kit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace mr::kit {

HWY_EXPORT(RowsToYuv);
HWY_EXPORT(RowToRgb);

void rgb_to_yuv(const ImageRgb& rgb, const YuvPlanes<std::uint8_t>& out) {
  MR_ASSERT(rgb.width % 2 == 0 && rgb.height % 2 == 0);
  apply_simd_override();
  const auto row = [&](int plane, std::size_t y) {
    return out.data[plane] + static_cast<std::ptrdiff_t>(y) * out.stride[plane];
  };
  parallel_for(rgb.height / 2, 32, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) {
      const int above = 2 * static_cast<int>(y);
      HWY_DYNAMIC_DISPATCH(RowsToYuv)
      (rgb.row(above), rgb.row(above + 1), rgb.width, row(0, 2 * y), row(0, 2 * y + 1), row(1, y),
       row(2, y));
    }
  });
}

namespace {

/// A row of chroma as a row of pixels sees it, in 4ths: three of the nearer row's, one of the
/// other's; one sample more at both ends.
void blend(const std::uint8_t* near, const std::uint8_t* far, int count, std::int16_t* out) {
  for (int i = 0; i < count; ++i) out[i + 1] = static_cast<std::int16_t>(3 * near[i] + far[i]);
  out[0] = out[1], out[count + 1] = out[count];
}

}  // namespace

void yuv_to_rgb(const YuvPlanes<const std::uint8_t>& yuv, ImageRgb& out) {
  apply_simd_override();
  constexpr int kRoom = 64;
  const int columns = (out.width + 1) / 2, rows = (out.height + 1) / 2;
  const auto row = [&](int plane, int y) { return yuv.data[plane] + y * yuv.stride[plane]; };
  parallel_for(out.height, 64, [&](std::size_t begin, std::size_t end) {
    std::vector<std::int16_t> cb(columns + 2 + kRoom), cr(columns + 2 + kRoom);
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      const int near = y / 2, far = std::clamp(y % 2 ? near + 1 : near - 1, 0, rows - 1);
      blend(row(1, near), row(1, far), columns, cb.data());
      blend(row(2, near), row(2, far), columns, cr.data());
      HWY_DYNAMIC_DISPATCH(RowToRgb)
      (row(0, y), cb.data() + 1, cr.data() + 1, out.width, out.row(y));
    }
  });
}

}  // namespace mr::kit
#endif
