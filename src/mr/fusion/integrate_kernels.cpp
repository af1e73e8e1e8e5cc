#include "mr/fusion/integrate_kernels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "mr/fusion/range_planes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mr/fusion/integrate_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h:
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace mr::fusion::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int kSide = VoxelBlock::kSide;
constexpr float kMost = VoxelBlock::kTruncated;

using Df = hn::CappedTag<float, 16>;
using Di = hn::RebindToSigned<Df>;
using Vf = hn::Vec<Df>;
using Vi = hn::Vec<Di>;
using Mf = hn::Mask<Df>;
constexpr Df df;
constexpr Di di;
constexpr hn::Rebind<std::int16_t, Df> d16;
constexpr hn::Rebind<std::uint16_t, Df> du16;

HWY_INLINE int lanes() { return static_cast<int>(hn::Lanes(df)); }

/// Stores a mask's bits where bit `i` of `bits` begins; up to 8 bytes more may be written.
template <typename D, typename M>
HWY_INLINE void store_bits(D d, M mask, std::size_t i, std::uint8_t* bits) {
  if (hn::Lanes(d) >= 8) {
    hn::StoreMaskBits(d, mask, bits + i / 8);
  } else {  // several times into one byte
    std::uint8_t few[8] = {};
    hn::StoreMaskBits(d, mask, few);
    if (i % 8 == 0) bits[i / 8] = 0;
    bits[i / 8] = static_cast<std::uint8_t>(bits[i / 8] | few[0] << i % 8);
  }
}

HWY_INLINE std::uint64_t bits_of(Mf mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(df, mask, bytes);
  return bytes[0] | static_cast<std::uint64_t>(bytes[1]) << 8;
}

/// [8 bits] a byte of ones for each bit that is set.
constexpr std::array<std::uint64_t, 256> kBytes = [] {
  std::array<std::uint64_t, 256> out{};
  for (int i = 0; i < 256; ++i)
    for (int b = 0; b < 8; ++b)
      if ((i >> b & 1) != 0) out[i] |= std::uint64_t{0xFF} << 8 * b;
  return out;
}();

// --- pixels and their points

struct Points {
  Vf x, y, z;
};

/// The points of pixels [x, x + N) of a row, in blocks from eye_block.
HWY_INLINE Points points_at(const FrameView& view, int y, int x, Vf depth) {
  const auto& ray = view.ray[y];
  const Vf s = hn::LoadU(df, view.s.data() + x), t = hn::LoadU(df, view.t.data() + x);
  const auto along = [&](float a, float b, float c, float e) HWY_ATTR {
    const Vf turned = hn::Add(hn::Mul(s, hn::Set(df, b)), hn::Mul(t, hn::Set(df, c)));
    return hn::Add(hn::Set(df, e), hn::Mul(depth, hn::Add(hn::Set(df, a), turned)));
  };
  return {along(ray[0].x, ray[1].x, ray[2].x, view.eye.x),
          along(ray[0].y, ray[1].y, ray[2].y, view.eye.y),
          along(ray[0].z, ray[1].z, ray[2].z, view.eye.z)};
}

HWY_INLINE Mf within(const Box3f& box, const Points& p) {
  const auto between = [](Vf v, float low, float high) HWY_ATTR {
    return hn::And(hn::Ge(v, hn::Set(df, low)), hn::Le(v, hn::Set(df, high)));
  };
  return hn::And(between(p.x, box.low.x, box.high.x),
                 hn::And(between(p.y, box.low.y, box.high.y), between(p.z, box.low.z, box.high.z)));
}

std::size_t CopyRows(const DepthFrame& frame, int begin, int end, FrameView& view) {
  constexpr float kNearest_m = 1e-6f, kFarthest_m = 1e5f;
  const Vf zero = hn::Zero(df), nothing = hn::Set(df, FrameView::kNothing);
  std::size_t refused = 0;
  for (int y = begin; y < end; ++y) {
    const float* const from = frame.depth.at(frame.region.x, frame.region.y + y);
    float* const row = view.row(y);
    std::copy(from, from + view.width, row);
    std::fill(row + view.width, row + view.stride - 1, 0.0f);
    row[-1] = FrameView::kNothing;
    for (int x = 0; x < view.width; x += lanes()) {
      const Vf d = hn::LoadU(df, row + x);
      const Mf measured =
          hn::And(hn::Gt(d, hn::Set(df, kNearest_m)), hn::Lt(d, hn::Set(df, kFarthest_m)));
      refused += hn::Lanes(df) - hn::CountTrue(df, hn::Or(measured, hn::Eq(d, zero)));
      const Mf kept = view.bounds
                          ? hn::And(measured, within(*view.bounds, points_at(view, y, x, d)))
                          : measured;
      hn::StoreU(hn::IfThenElse(kept, d, nothing), df, row + x);
    }
    std::fill(row + view.width, row + view.stride - 1, FrameView::kNothing);
  }
  return refused;
}

// --- allocation: ranges of voxels

/// Bounding boxes of the points in each column of a tile row.
struct ColumnBounds {
  std::array<std::vector<float>, 3> low, high;

  void reset(int width) {
    for (auto& v : low) v.assign(width + FrameView::kPadding, 1e30f);
    for (auto& v : high) v.assign(width + FrameView::kPadding, -1e30f);
  }
};

HWY_INLINE void add_row(const FrameView& view, int y, ColumnBounds& bounds) {
  for (int x = 0; x < view.width; x += lanes()) {
    const Vf d = hn::LoadU(df, view.row(y) + x);
    const Mf measured = hn::Gt(d, hn::Zero(df));
    if (hn::AllFalse(df, measured)) continue;
    const bool all = hn::AllTrue(df, measured);
    const Points p = points_at(view, y, x, d);
    const auto widen = [&](Vf v, float* low, float* high) HWY_ATTR {
      const Vf l = hn::LoadU(df, low + x), h = hn::LoadU(df, high + x);
      hn::StoreU(hn::Min(l, all ? v : hn::IfThenElse(measured, v, l)), df, low + x);
      hn::StoreU(hn::Max(h, all ? v : hn::IfThenElse(measured, v, h)), df, high + x);
    };
    widen(p.x, bounds.low[0].data(), bounds.high[0].data());
    widen(p.y, bounds.low[1].data(), bounds.high[1].data());
    widen(p.z, bounds.low[2].data(), bounds.high[2].data());
  }
}

/// The least value of a tile's columns and the column after them.
HWY_INLINE float least(const float* v) {
  static_assert(kTile == 4);
  return std::min(std::min(std::min(v[0], v[1]), std::min(v[2], v[3])), v[4]);
}
HWY_INLINE float most(const float* v) {
  return std::max(std::max(std::max(v[0], v[1]), std::max(v[2], v[3])), v[4]);
}

/// Largest extent of a tile without a depth edge: kSteepTile times that of a surface facing the
/// sensor, at most kLargestTile.
constexpr float kSteepTile = 3, kLargestTile = 16;  // blocks

/// If pixels lie farther apart than twice this, voxels between them may be missed.
constexpr float kMostHalfPixel = 1;  // blocks

/// Appends the range of a tile's pixels between two depths, extended by the band of mixed pixels
/// behind them. False, without effect: the points extend too far.
HWY_INLINE bool layer_range(const FrameView& view, const Rect& tile, float nearest, float farthest,
                            const TileRule& rule, float half_pixel, std::vector<VoxelRange>& out) {
  Box3f points, all;
  for (int y = tile.y; y < tile.y + tile.height; ++y)
    for (int x = tile.x; x < tile.x + tile.width; ++x) {
      const float d = view.row(y)[x];
      if (d < nearest || d > farthest) continue;
      const Vec3f ray = view.direction(x, y), p = view.eye + ray * d;
      points.add(p), all.add(p), all.add(view.eye + ray * (d + rule.band_m));
    }
  if (points.empty()) return true;
  const Vec3f extent = points.high - points.low;
  if (std::max({extent.x, extent.y, extent.z}) > rule.largest) return false;
  out.push_back(voxels_within(all.low, all.high, rule.margin + half_pixel));
  return true;
}

/// Appends the ranges of a tile with a depth edge: one for the nearer and one for the farther
/// surface, or if these extend too far, one per pixel.
HWY_INLINE void edge_ranges(const FrameView& view, const Rect& tile, const TileRule& rule,
                            float half_pixel, std::vector<VoxelRange>& out) {
  float nearest = 1e30f, farthest = 0;
  for (int y = tile.y; y < tile.y + tile.height; ++y)
    for (int x = tile.x; x < tile.x + tile.width; ++x) {
      const float d = view.row(y)[x];
      if (d > 0) nearest = std::min(nearest, d), farthest = std::max(farthest, d);
    }
  if (view.slanted) steep_ranges(view, tile, rule.margin, out);
  const float middle = 0.5f * (nearest + farthest);
  const std::size_t before = out.size();
  if (layer_range(view, tile, nearest, middle, rule, half_pixel, out) &&
      layer_range(view, tile, std::nextafter(middle, farthest), farthest, rule, half_pixel, out))
    return;
  out.resize(before);
  for (int y = tile.y; y < tile.y + tile.height; ++y)
    for (int x = tile.x; x < tile.x + tile.width; ++x) {
      const float d = view.row(y)[x];
      if (d > 0) layer_range(view, {x, y, 1, 1}, d, d, rule, half_pixel, out);
    }
}

void TileRanges(const FrameView& view, int tile_row, const TileRule& rule,
                std::vector<VoxelRange>& out) {
  thread_local ColumnBounds bounds;
  bounds.reset(view.width);
  // One row and column more than the tile, as the surface continues between tiles.
  const int top = tile_row * kTile, bottom = std::min(top + kTile, view.height - 1);
  for (int y = top; y <= bottom; ++y) add_row(view, y, bounds);
  for (int x = 0; x < view.width; x += kTile) {
    const Vec3f low{least(&bounds.low[0][x]), least(&bounds.low[1][x]), least(&bounds.low[2][x])};
    const Vec3f high{most(&bounds.high[0][x]), most(&bounds.high[1][x]), most(&bounds.high[2][x])};
    if (low.x > high.x) continue;
    const Vec3f extent = high - low;
    const float largest = std::max({extent.x, extent.y, extent.z});
    const float pixel = view.pixel_rad * (length((low + high) * 0.5f - view.eye) + 0.5f * largest);
    const float half_pixel = std::min(0.5f * pixel, kMostHalfPixel);
    if (largest <= std::clamp(kSteepTile * kTile * pixel, rule.largest, kLargestTile))
      out.push_back(voxels_within(low, high, rule.margin + half_pixel));
    else
      edge_ranges(view, {x, top, std::min(kTile + 1, view.width - x), bottom + 1 - top}, rule,
                  half_pixel, out);
  }
}

// --- sampling a frame at voxels

/// Signed distance of voxels in front of the surface measured by their pixels, and depth of the
/// voxels. Invalid pixels: far behind.
struct Sample {
  Vf in_front_m, depth_m;
};

/// Fast rounding for |v| < 2²²: adding 1.5 · 2²³ leaves the nearest integer in the lowest bits.
/// Omits the range checks of conversion instructions.
constexpr float kRounder = 12582912.0f;
constexpr std::int32_t kRounderBits = 0x4B400000;
HWY_INLINE Vi raw_rounded(Vf v) { return hn::BitCast(di, hn::Add(v, hn::Set(df, kRounder))); }
HWY_INLINE Vi rounded(Vf v) { return hn::Sub(raw_rounded(v), hn::Set(di, kRounderBits)); }

/// Samples a pinhole picture by nearest neighbour.
struct Pinhole {
  explicit Pinhole(const FrameView& v)
      : depth(v.depth.data()),
        right(static_cast<float>(v.width + 1)),
        bottom(static_cast<float>(v.height + 1)),
        stride(v.stride),
        raw_origin(static_cast<std::int32_t>(static_cast<std::uint32_t>(kRounderBits) *
                                             static_cast<std::uint32_t>(v.stride + 1))) {}

  HWY_INLINE void project(Vf U, Vf V, Vf Z, Vf& u, Vf& v) const {
    const Vf zero = hn::Zero(df);
    // Behind the camera: maps to the corner of the border, which is invalid.
    const Vf per_z = hn::IfThenElseZero(hn::Gt(Z, zero), hn::Div(hn::Set(df, 1.0f), Z));
    u = hn::Max(zero, hn::Min(hn::Mul(U, per_z), hn::Set(df, right)));
    v = hn::Max(zero, hn::Min(hn::Mul(V, per_z), hn::Set(df, bottom)));
  }
  HWY_INLINE Vi place(Vf u, Vf v) const {
    const Vi raw_place = hn::Add(hn::Mul(raw_rounded(v), hn::Set(di, stride)), raw_rounded(u));
    return hn::Sub(raw_place, hn::Set(di, raw_origin));
  }
  HWY_INLINE Sample operator()(Vf U, Vf V, Vf Z) const {
    Vf u, v;
    project(U, V, Z, u, v);
    return {hn::Sub(hn::GatherIndex(df, depth, place(u, v)), Z), Z};
  }

  const float* depth;
  float right, bottom;
  std::int32_t stride, raw_origin;  ///< raw_origin: index that raw_rounded gives for (0, 0)
};

/// The tangent planes of pixels (RangePlane).
struct Planes {
  explicit Planes(const FrameView& view) : first(&view.planes[0].inverse) {}

  HWY_INLINE Vf field(Vi place, int i) const {
    return hn::GatherIndex(df, first, hn::Add(hn::ShiftLeft<2>(place), hn::Set(di, i)));
  }
  /// Depth of the plane at an offset from the pixel's centre; undefined where `valid` is not set.
  HWY_INLINE Vf depth(Vi place, Vf right, Vf down, Mf& valid) const {
    const Vf measured = field(place, 0);
    const Vf moved = hn::Add(hn::Mul(field(place, 1), right), hn::Mul(field(place, 2), down));
    const Vf half = hn::Mul(measured, hn::Set(df, 0.5f));  // limits extrapolation
    const Vf inverse = hn::Add(measured, hn::Max(hn::Neg(half), hn::Min(moved, half)));
    valid = hn::Gt(measured, hn::Zero(df));
    return hn::Div(hn::Set(df, 1.0f), hn::IfThenElse(valid, inverse, hn::Set(df, 1.0f)));
  }

  const float* first;
};

/// Samples a pinhole picture by a plane per pixel (DepthFrame::slanted).
struct SlantedPinhole {
  explicit SlantedPinhole(const FrameView& v)
      : pinhole(v), planes(v), band(-v.truncation_m), least_band(-v.least_band_m) {}

  HWY_INLINE Sample operator()(Vf U, Vf V, Vf Z) const {
    Vf u, v;
    pinhole.project(U, V, Z, u, v);
    const auto off = [](Vf x) HWY_ATTR { return hn::Sub(x, hn::ConvertTo(df, rounded(x))); };
    Mf valid;
    const Vi place = pinhole.place(u, v);
    const Vf there = planes.depth(place, off(u), off(v), valid);
    const Vf along = hn::Sub(there, Z), in_front = hn::Mul(along, planes.field(place, 3));
    // Voxels far behind a grazing surface may belong to other surface: not inside.
    const Mf near =
        hn::Or(hn::Ge(along, hn::Set(df, band)), hn::Ge(in_front, hn::Set(df, least_band)));
    return {hn::IfThenElse(hn::And(valid, near), in_front, hn::Set(df, FrameView::kNothing)), Z};
  }

  Pinhole pinhole;
  Planes planes;
  float band, least_band;
};

/// The angle of (x, y) from the x axis, within 3e-7 rad; 0 at the origin.
HWY_INLINE Vf angle_of(Vf y, Vf x) {
  const Vf ax = hn::Abs(x), ay = hn::Abs(y);
  const Vf t = hn::Div(hn::Min(ax, ay), hn::Max(hn::Max(ax, ay), hn::Set(df, 1e-20f)));
  const Vf t2 = hn::Mul(t, t);
  Vf sum = hn::Set(df, -0.00455979199f);
  for (const float c : {0.0237805186f, -0.0588297531f, 0.0986886546f, -0.140032902f, 0.199669618f,
                        -0.333318127f, 0.999999882f})
    sum = hn::Add(hn::Mul(sum, t2), hn::Set(df, c));
  const Vf octant = hn::Mul(t, sum);
  const Vf quadrant =
      hn::IfThenElse(hn::Gt(ay, ax), hn::Sub(hn::Set(df, 1.57079633f), octant), octant);
  const Vf half = hn::IfThenElse(hn::Lt(x, hn::Zero(df)),
                                 hn::Sub(hn::Set(df, 3.14159265f), quadrant), quadrant);
  return hn::IfThenElse(hn::Lt(y, hn::Zero(df)), hn::Neg(half), half);
}

struct Spherical {
  explicit Spherical(const FrameView& v) : view(v), planes(v) {}

  /// The column at an angle to the right of the row's start; `rest`: the angle from its centre.
  HWY_INLINE Vi column_of(Vf right, Vf& rest) const {
    const Vf per_rad = hn::Set(df, view.columns_per_rad);
    const Vf around = hn::Mul(per_rad, hn::Set(df, 6.28318531f));
    Vf u = hn::Add(hn::Mul(right, per_rad), hn::Set(df, view.first_column));
    u = hn::IfThenElse(hn::Lt(u, hn::Zero(df)), hn::Add(u, around), u);
    u = hn::IfThenElse(hn::Ge(u, around), hn::Sub(u, around), u);
    const Vf last = hn::Set(df, static_cast<float>(view.wraps ? view.width - 1 : view.width));
    const Vf first = hn::Set(df, view.wraps ? 0.0f : -1.0f);
    const Vf column = hn::Max(first, hn::Min(hn::Floor(u), last));
    rest = hn::Div(hn::Sub(hn::Sub(u, column), hn::Set(df, 0.5f)), per_rad);
    return hn::Add(hn::ConvertTo(di, column), hn::Set(di, 1));
  }

  HWY_INLINE Sample operator()(Vf x, Vf y, Vf z) const {
    const Vf flat2 = hn::Add(hn::Mul(x, x), hn::Mul(z, z));
    const Vf range = hn::Sqrt(hn::Add(flat2, hn::Mul(y, y)));
    const Vf down = angle_of(y, hn::Sqrt(flat2));
    const Vf bin = hn::Mul(hn::Add(down, hn::Set(df, 1.57079633f)), hn::Set(df, view.bins_per_rad));
    const Vf last_bin = hn::Set(df, static_cast<float>(view.row_at.size() - 1));
    const Vi row = hn::GatherIndex(
        di, view.row_at.data(), hn::ConvertTo(di, hn::Max(hn::Zero(df), hn::Min(bin, last_bin))));
    const Vf row_down = hn::GatherIndex(df, view.row_down.data(), row);
    const Vf row_right = hn::GatherIndex(df, view.row_right.data(), row);
    Vf rest_right;
    const Vi column = column_of(hn::Sub(angle_of(x, z), row_right), rest_right);
    const Vi place = hn::Add(hn::Mul(row, hn::Set(di, view.stride)), column);
    Mf valid;
    const Vf there = planes.depth(place, rest_right, hn::Sub(down, row_down), valid);
    const Vf in_front = hn::Mul(hn::Sub(there, range), planes.field(place, 3));
    return {hn::IfThenElse(valid, in_front, hn::Set(df, FrameView::kNothing)), range};
  }

  const FrameView& view;
  Planes planes;
};

/// Iterates over a block's voxels, as many at a time as SIMD lanes.
class BlockSampler {
 public:
  BlockSampler(const FrameView& view, const VoxelBlock& block)
      : view_(view),
        corner_(view.origin + view.axis[0] * (block.coordinate.x * double{kSide}) +
                view.axis[1] * (block.coordinate.y * double{kSide}) +
                view.axis[2] * (block.coordinate.z * double{kSide})) {}

  HWY_INLINE void set_layer(int z) {
    const Vec3f first = vec_cast<float>(corner_ + view_.axis[2] * z);
    u_ = first.x, v_ = first.y, z_ = first.z;
  }
  template <typename Camera>
  HWY_INLINE Sample sample(const Camera& camera, int i) const {
    return camera(hn::Add(hn::Set(df, u_), hn::LoadU(df, view_.dU.data() + i)),
                  hn::Add(hn::Set(df, v_), hn::LoadU(df, view_.dV.data() + i)),
                  hn::Add(hn::Set(df, z_), hn::LoadU(df, view_.dZ.data() + i)));
  }

 private:
  const FrameView& view_;
  Vec3d corner_;
  float u_ = 0, v_ = 0, z_ = 0;
};

/// Quantizes distances for storage: to the nearest odd number, so never 0.
HWY_INLINE Vi stored(Vf distance) {
  const Vf half = hn::Set(df, 0.5f);
  return hn::Or(hn::ShiftLeft<1>(rounded(hn::Sub(hn::Mul(distance, half), half))), hn::Set(di, 1));
}

/// Sets a layer's bit masks from `seen` and the stored distances.
HWY_INLINE void set_bits(int z, std::uint64_t seen, VoxelBlock& block) {
  constexpr hn::CappedTag<std::int16_t, 64> d;
  const std::int16_t* const distance = block.distance.data() + z * 64;
  alignas(8) std::uint8_t inside[8 + 64], near[8 + 64];  // room for what is stored past the end
  for (std::size_t i = 0; i < 64; i += hn::Lanes(d)) {
    const auto v = hn::LoadU(d, distance + i);
    store_bits(d, hn::Lt(v, hn::Zero(d)), i, inside);
    store_bits(d, hn::Lt(v, hn::Set(d, VoxelBlock::kTruncated)), i, near);
  }
  std::uint64_t inside_word, near_word;
  std::memcpy(&inside_word, inside, 8), std::memcpy(&near_word, near, 8);
  block.seen[z] = seen, block.inside[z] = inside_word & seen, block.near[z] = near_word & seen;
}

HWY_INLINE Vf limited(Vf distance) {
  return hn::Max(hn::Set(df, -kMost), hn::Min(distance, hn::Set(df, kMost)));
}

template <typename Camera>
HWY_INLINE void first_frame(const FrameView& view, std::uint64_t rows, VoxelBlock& block) {
  const Camera camera(view);
  const Vf behind = hn::Set(df, -view.truncation_m), scale = hn::Set(df, kMost / view.truncation_m);
  BlockSampler sampler(view, block);
  for (int z = 0; z < kSide; ++z) {
    const std::uint64_t wanted = kBytes[rows >> 8 * z & 0xFF];
    if (wanted == 0) {
      block.seen[z] = block.inside[z] = block.near[z] = 0;
      continue;
    }
    std::uint64_t seen = 0;
    sampler.set_layer(z);
    for (int i = 0; i < 64; i += lanes()) {
      if ((wanted >> i & ((std::uint64_t{1} << lanes()) - 1)) == 0) continue;
      const Sample s = sampler.sample(camera, i);
      const Vi value = stored(limited(hn::Mul(s.in_front_m, scale)));
      hn::StoreU(hn::DemoteTo(d16, value), d16, block.distance.data() + z * 64 + i);
      seen |= bits_of(hn::Ge(s.in_front_m, behind)) << i;
    }
    set_bits(z, seen & wanted, block);
  }
}

void IntegrateFirst(const FrameView& view, std::uint64_t rows, VoxelBlock& block) {
  if (view.spherical)
    first_frame<Spherical>(view, rows, block);
  else if (view.slanted)
    first_frame<SlantedPinhole>(view, rows, block);
  else
    first_frame<Pinhole>(view, rows, block);
}

/// Standard deviation of a measurement at some depth, metres.
HWY_INLINE Vf sigma_m(const Precision& p, Vf depth) {
  return hn::Add(hn::Set(df, static_cast<float>(p.base_m)),
                 hn::Mul(hn::Set(df, static_cast<float>(p.per_m2)), hn::Mul(depth, depth)));
}

/// The weight of one measurement: inverse variance against that at one metre, within limits.
HWY_INLINE Vf weight_of(const FrameView& view, Vf depth) {
  constexpr float kUnit = VoxelBlock::kWeightUnit;
  if (!view.precision) return hn::Set(df, kUnit);
  const float at_1m = static_cast<float>(view.precision->sigma_m(1));
  const Vf ratio = hn::Div(hn::Set(df, at_1m), sigma_m(*view.precision, depth));
  const Vf weight = hn::Mul(hn::Set(df, kUnit), hn::Mul(ratio, ratio));
  return hn::ConvertTo(
      df, rounded(hn::Max(hn::Set(df, 1.0f), hn::Min(weight, hn::Set(df, 4 * kUnit)))));
}

/// The stored state of voxels.
struct Voxels {
  Vf distance, weight;
};

HWY_INLINE Voxels load(const VoxelBlock& block, const VoxelBlock::Weights& weights, int i) {
  return {hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(d16, block.distance.data() + i))),
          hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(du16, weights.data() + i)))};
}

/// One update of the weighted average.
HWY_INLINE Voxels averaged(const FrameView& view, const Sample& s, const Voxels& old) {
  constexpr float kMostWeight = 65535;
  const Mf seen = hn::Ge(s.in_front_m, hn::Set(df, -view.truncation_m));
  const Vf value = limited(hn::Mul(s.in_front_m, hn::Set(df, kMost / view.truncation_m)));
  const Vf weight = weight_of(view, s.depth_m), sum = hn::Add(old.weight, weight);
  const Vf mean = hn::Div(hn::Add(hn::Mul(old.distance, old.weight), hn::Mul(value, weight)), sum);
  return {hn::IfThenElse(seen, mean, old.distance),
          hn::IfThenElse(seen, hn::Min(sum, hn::Set(df, kMostWeight)), old.weight)};
}

template <typename Camera>
HWY_INLINE void next_frame(const FrameView& view, VoxelBlock& block, VoxelBlock::Weights& weights) {
  const Camera camera(view);
  BlockSampler sampler(view, block);
  for (int z = 0; z < kSide; ++z) {
    std::uint64_t seen = 0;
    sampler.set_layer(z);
    for (int i = 0; i < 64; i += lanes()) {
      const Voxels now =
          averaged(view, sampler.sample(camera, i), load(block, weights, z * 64 + i));
      const Vi value = stored(now.distance);
      hn::StoreU(hn::DemoteTo(d16, value), d16, block.distance.data() + z * 64 + i);
      hn::StoreU(hn::DemoteTo(du16, rounded(now.weight)), du16, weights.data() + z * 64 + i);
      seen |= bits_of(hn::Gt(now.weight, hn::Zero(df))) << i;
    }
    set_bits(z, seen, block);
  }
}

void IntegrateNext(const FrameView& view, VoxelBlock& block, VoxelBlock::Weights& weights) {
  if (view.spherical)
    next_frame<Spherical>(view, block, weights);
  else if (view.slanted)
    next_frame<SlantedPinhole>(view, block, weights);
  else
    next_frame<Pinhole>(view, block, weights);
}

}  // namespace mr::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace mr::fusion {

HWY_EXPORT(CopyRows);
HWY_EXPORT(TileRanges);
HWY_EXPORT(IntegrateFirst);
HWY_EXPORT(IntegrateNext);

std::size_t copy_rows(const DepthFrame& frame, int begin, int end, FrameView& view) {
  return HWY_DYNAMIC_DISPATCH(CopyRows)(frame, begin, end, view);
}
void tile_ranges(const FrameView& view, int tile_row, const TileRule& rule,
                 std::vector<VoxelRange>& out) {
  HWY_DYNAMIC_DISPATCH(TileRanges)(view, tile_row, rule, out);
}
void integrate_first(const FrameView& view, std::uint64_t rows, VoxelBlock& block) {
  HWY_DYNAMIC_DISPATCH(IntegrateFirst)(view, rows, block);
}
void integrate_next(const FrameView& view, VoxelBlock& block, VoxelBlock::Weights& weights) {
  HWY_DYNAMIC_DISPATCH(IntegrateNext)(view, block, weights);
}

}  // namespace mr::fusion
#endif
