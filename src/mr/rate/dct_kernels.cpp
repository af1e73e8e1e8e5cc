#include "mr/rate/dct_kernels.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "mr/core/simd.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mr/rate/dct_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h:
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace mr::rate::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int kN = kFeatureBlock;

using Df = hn::CappedTag<float, 16>;
using Di = hn::RebindToSigned<Df>;
using D8 = hn::Rebind<std::uint8_t, Df>;
using Vf = hn::Vec<Df>;
using Mf = hn::Mask<Df>;
constexpr Df df;
constexpr Di di;
constexpr D8 d8;

HWY_INLINE int lanes() { return static_cast<int>(hn::Lanes(df)); }

// --- the transform: each lane is one row or column of a block

// Functions inlined and loops unrolled, so that arrays of vectors are registers. Sanitized, that
// takes minutes to compile; single numbers do not gain by it.
#ifdef MR_SANITIZED
#define MR_DCT_INLINE
#else
#define MR_DCT_INLINE HWY_INLINE
#endif
#if HWY_TARGET == HWY_SCALAR || defined(MR_SANITIZED)
constexpr int kUnroll = 1;
#else
constexpr int kUnroll = kN;
#endif

/// sin(x) for x in [0, π/2], by its series.
constexpr double sine(double x) {
  double term = x, sum = x;
  for (int i = 2; i < 24; i += 2) sum += term *= -x * x / (i * (i + 1));
  return sum;
}
constexpr double cosine(double x) { return sine(std::numbers::pi / 2 - x); }

template <int kCount>
MR_DCT_INLINE void dct2(Vf* x);

/// DCT-IV of `kCount` values, in place, not normalised:
///   X[k] = Σ x[j] cos(π (2 j + 1) (2 k + 1) / (4 kCount))
/// as rotations and two DCT-II of half the length (Plonka and Tasche 2005).
template <int kCount>
MR_DCT_INLINE void dct4(Vf* x) {
  if constexpr (kCount == 1) {
    x[0] = hn::Mul(x[0], hn::Set(df, static_cast<float>(cosine(std::numbers::pi / 4))));
  } else {
    constexpr int kHalf = kCount / 2;
    Vf p[kHalf], q[kHalf];
    HWY_UNROLL(kUnroll)
    for (int j = 0; j < kHalf; ++j) {
      const double angle = std::numbers::pi * (2 * j + 1) / (4 * kCount);
      const Vf c = hn::Set(df, static_cast<float>(cosine(angle)));
      const Vf s = hn::Set(df, static_cast<float>(sine(angle)));
      const Vf xs = hn::Mul(x[j], s), yc = hn::Mul(x[kCount - 1 - j], c);
      p[j] = hn::Add(hn::Mul(x[j], c), hn::Mul(x[kCount - 1 - j], s));
      q[j] = j % 2 == 0 ? hn::Sub(xs, yc) : hn::Sub(yc, xs);
    }
    dct2<kHalf>(p);
    dct2<kHalf>(q);
    x[0] = p[0], x[kCount - 1] = q[0];
    HWY_UNROLL(kUnroll)
    for (int k = 1; k < kHalf; ++k) {
      x[2 * k - 1] = hn::Add(p[k], q[kHalf - k]);
      x[2 * k] = hn::Sub(p[k], q[kHalf - k]);
    }
  }
}

/// DCT-II of `kCount` values, in place, not normalised:
///   X[k] = Σ x[j] cos(π (2 j + 1) k / (2 kCount))
/// Even k: the DCT-II of sums of opposite values; odd k: the DCT-IV of their differences.
template <int kCount>
MR_DCT_INLINE void dct2(Vf* x) {
  if constexpr (kCount > 1) {
    constexpr int kHalf = kCount / 2;
    Vf sums[kHalf], differences[kHalf];
    HWY_UNROLL(kUnroll)
    for (int j = 0; j < kHalf; ++j) {
      sums[j] = hn::Add(x[j], x[kCount - 1 - j]);
      differences[j] = hn::Sub(x[j], x[kCount - 1 - j]);
    }
    dct2<kHalf>(sums);
    dct4<kHalf>(differences);
    HWY_UNROLL(kUnroll)
    for (int k = 0; k < kHalf; ++k) x[2 * k] = sums[k], x[2 * k + 1] = differences[k];
  }
}

// --- loads that transpose

#if HWY_TARGET == HWY_SCALAR
HWY_INLINE void load_transposed(const float* rows, Vf* x) {
  HWY_UNROLL(kUnroll)
  for (int i = 0; i < kN; ++i) x[i] = hn::Load(df, rows + i);
}
#else
/// Four values of each of the rows 0, 4, 8, … of a block.
template <typename D>
HWY_INLINE hn::Vec<D> load_fours(D d, const float* rows) {
  if constexpr (hn::MaxLanes(d) <= 4) {
    return hn::Load(d, rows);
  } else {
    constexpr hn::Half<D> half;
    return hn::Combine(d, load_fours(half, rows + hn::MaxLanes(half) * kN), load_fours(half, rows));
  }
}

/// As many rows of a block as there are lanes: x[i] gets their value i.
HWY_INLINE void load_transposed(const float* rows, Vf* x) {
  HWY_UNROLL(kUnroll)
  for (int i = 0; i < kN; i += 4) {
    const Vf a = load_fours(df, rows + i), b = load_fours(df, rows + kN + i),
             c = load_fours(df, rows + 2 * kN + i), d = load_fours(df, rows + 3 * kN + i);
    const Vf ac = hn::InterleaveLower(df, a, c), bd = hn::InterleaveLower(df, b, d);
    const Vf ac_high = hn::InterleaveUpper(df, a, c), bd_high = hn::InterleaveUpper(df, b, d);
    x[i] = hn::InterleaveLower(df, ac, bd), x[i + 1] = hn::InterleaveUpper(df, ac, bd);
    x[i + 2] = hn::InterleaveLower(df, ac_high, bd_high);
    x[i + 3] = hn::InterleaveUpper(df, ac_high, bd_high);
  }
}
#endif

// --- blocks

/// Sums of the columns of a block.
struct alignas(64) ColumnSums {
  float at[kN];

  /// Pairwise, in an order that does not depend on the number of lanes.
  float total() {
    for (int half = kN / 2; half > 0; half /= 2)
      for (int i = 0; i < half; ++i) at[i] += at[i + half];
    return at[0];
  }
};

/// The DCT along the columns x .. x + lanes of a block, less its first pixel.
HWY_INLINE void transform_columns(const float* pixels, std::ptrdiff_t stride, int x, float* out,
                                  ColumnSums& sums, ColumnSums& squares) {
  const Vf first = hn::Set(df, pixels[0]);
  Vf v[kN], sum = hn::Zero(df), square = hn::Zero(df);
  HWY_UNROLL(kUnroll)
  for (int y = 0; y < kN; ++y) {
    v[y] = hn::Sub(hn::LoadU(df, pixels + y * stride + x), first);
    sum = hn::Add(sum, v[y]);
    square = hn::Add(square, hn::Mul(v[y], v[y]));
  }
  hn::Store(sum, df, sums.at + x);
  hn::Store(square, df, squares.at + x);
  dct2<kN>(v);
  HWY_UNROLL(kUnroll)
  for (int j = 0; j < kN; ++j) hn::Store(v[j], df, out + j * kN + x);
}

/// The DCT along rows j .. j + lanes of what transform_columns() made of all columns.
HWY_INLINE void transform_rows(const float* columns, const float* weights, int j, float* dct,
                               ColumnSums& spatial, ColumnSums& temporal) {
  Vf v[kN], energy = hn::Zero(df), change = hn::Zero(df);
  load_transposed(columns + j * kN, v);
  dct2<kN>(v);
  HWY_UNROLL(kUnroll)
  for (int i = 0; i < kN; ++i) {
    const Vf weight = hn::Load(df, weights + i * kN + j);
    const Vf difference = hn::Sub(v[i], hn::Load(df, dct + i * kN + j));
    energy = hn::Add(energy, hn::Mul(weight, hn::Abs(v[i])));
    change = hn::Add(change, hn::Mul(weight, hn::Abs(difference)));
    hn::Store(v[i], df, dct + i * kN + j);
  }
  hn::Store(energy, df, spatial.at + j);
  hn::Store(change, df, temporal.at + j);
}

BlockFeatures FeaturesOfBlock(const float* pixels, std::ptrdiff_t stride, const float* weights,
                              float* dct) {
  ColumnSums sums, squares, spatial, temporal;
  alignas(64) float columns[kN * kN];
  HWY_UNROLL(1)
  for (int x = 0; x < kN; x += lanes())
    transform_columns(pixels, stride, x, columns, sums, squares);
  HWY_UNROLL(1)
  for (int j = 0; j < kN; j += lanes()) transform_rows(columns, weights, j, dct, spatial, temporal);
  return {spatial.total(), temporal.total(), pixels[0], sums.total(), squares.total()};
}

// --- rows of pixels

void LumaRow(const std::uint8_t* rgb, int width, float* luma) {
  constexpr float kRed = 0.2126f, kGreen = 0.7152f, kBlue = 0.0722f;
  const auto number = [](hn::Vec<D8> v)
                          HWY_ATTR { return hn::ConvertTo(df, hn::PromoteTo(di, v)); };
  int x = 0;
  for (; x + lanes() <= width; x += lanes()) {
    hn::Vec<D8> r, g, b;
    hn::LoadInterleaved3(d8, rgb + 3 * x, r, g, b);
    const Vf red = hn::Mul(number(r), hn::Set(df, kRed));
    const Vf green = hn::Mul(number(g), hn::Set(df, kGreen));
    const Vf blue = hn::Mul(number(b), hn::Set(df, kBlue));
    hn::StoreU(hn::Add(hn::Add(red, green), blue), df, luma + x);
  }
  for (; x < width; ++x)
    luma[x] = rgb[3 * x] * kRed + rgb[3 * x + 1] * kGreen + rgb[3 * x + 2] * kBlue;
}

HWY_INLINE Mf measured(Vf depth_m) {
  return hn::And(hn::Gt(depth_m, hn::Zero(df)), hn::Lt(depth_m, hn::Set(df, kFarthest_m)));
}

void DepthRow(const float* depth_m, int width, float before_m, float* depth_mm) {
  constexpr float kMm = 1000;
  const auto fill = [&](int begin, int end) {
    for (int x = begin; x < end; ++x) {
      before_m = is_measured(depth_m[x]) ? depth_m[x] : before_m;
      depth_mm[x] = before_m * kMm;
    }
  };
  int x = 0;
  for (; x + lanes() <= width; x += lanes()) {
    const Vf depth = hn::LoadU(df, depth_m + x);
    const Mf valid = measured(depth);
    if (hn::AllTrue(df, valid)) {
      hn::StoreU(hn::Mul(depth, hn::Set(df, kMm)), df, depth_mm + x);
      before_m = depth_m[x + lanes() - 1];
    } else if (hn::AllFalse(df, valid)) {
      hn::StoreU(hn::Set(df, before_m * kMm), df, depth_mm + x);
    } else {
      fill(x, x + lanes());
    }
  }
  fill(x, width);
}

/// Of noise: `base` + `per_m2` z², times the number of standard deviations.
DepthChange ReplaceDepthRow(const float* depth_m, int width, float base, float per_m2,
                            float* before_m) {
  DepthChange change;
  int x = 0;
  for (; x + lanes() <= width; x += lanes()) {
    const Vf now = hn::LoadU(df, depth_m + x), before = hn::LoadU(df, before_m + x);
    const Mf both = hn::And(measured(now), measured(before));
    const Vf farther = hn::Max(now, before);
    const Vf noise =
        hn::Add(hn::Set(df, base), hn::Mul(hn::Set(df, per_m2), hn::Mul(farther, farther)));
    change.measured += hn::CountTrue(df, both);
    change.moved += hn::CountTrue(df, hn::And(both, hn::Gt(hn::Abs(hn::Sub(now, before)), noise)));
    hn::StoreU(now, df, before_m + x);
  }
  for (; x < width; ++x) {
    const float now = depth_m[x], before = before_m[x], farther = now > before ? now : before;
    const bool both = is_measured(now) && is_measured(before);
    change.measured += both;
    change.moved += both && std::abs(now - before) > base + per_m2 * (farther * farther);
    before_m[x] = now;
  }
  return change;
}

}  // namespace mr::rate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace mr::rate {

HWY_EXPORT(FeaturesOfBlock);
HWY_EXPORT(LumaRow);
HWY_EXPORT(DepthRow);
HWY_EXPORT(ReplaceDepthRow);

namespace {

/// Of |DCT(i, j)|: the paper's weight, and what normalises the transform.
DctBlock make_weights() {
  constexpr int kSide = kFeatureBlock;
  const auto norm = [](int frequency) { return std::sqrt((frequency == 0 ? 1.0 : 2.0) / kSide); };
  DctBlock weights;
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j) {
      const double part = (i + 1) * (j + 1) / static_cast<double>(kSide * kSide);
      weights.values[i * kSide + j] =
          static_cast<float>(std::exp(part * part - 1) * norm(i) * norm(j));
    }
  weights.values[0] = 0;
  return weights;
}

}  // namespace

BlockFeatures block_features(const float* pixels, std::ptrdiff_t stride, DctBlock& dct) {
  static const DctBlock weights = make_weights();
  return HWY_DYNAMIC_DISPATCH(FeaturesOfBlock)(pixels, stride, weights.values.data(),
                                               dct.values.data());
}

void luma_row(const std::uint8_t* rgb, int width, float* luma) {
  HWY_DYNAMIC_DISPATCH(LumaRow)(rgb, width, luma);
}

void depth_row(const float* depth_m, int width, float before_m, float* depth_mm) {
  HWY_DYNAMIC_DISPATCH(DepthRow)(depth_m, width, before_m, depth_mm);
}

DepthChange replace_depth_row(const float* depth_m, int width, const Precision& precision,
                              double sigmas, float* before_m) {
  return HWY_DYNAMIC_DISPATCH(ReplaceDepthRow)(
      depth_m, width, static_cast<float>(sigmas * precision.base_m),
      static_cast<float>(sigmas * precision.per_m2), before_m);
}

}  // namespace mr::rate
#endif
