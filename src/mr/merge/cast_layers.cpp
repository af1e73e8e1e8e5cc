#include "mr/merge/cast_layers.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <mutex>
#include <numeric>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/kit/raster.h"

namespace mr::merge {
namespace {

// ------------------------------------------------------------ lanes

using Float4 = float __attribute__((vector_size(16)));
using Int4 = std::int32_t __attribute__((vector_size(16)));

Float4 all4(float x) { return Float4{x, x, x, x}; }
Int4 all4(std::int32_t x) { return Int4{x, x, x, x}; }

template <typename Lanes>
Lanes load4(const void* from) {
  Lanes out;
  std::memcpy(&out, from, sizeof(out));
  return out;
}

/// Bit i: lane i is negative.
unsigned signs(Int4 lanes) {
#ifdef __SSE2__
  return static_cast<unsigned>(_mm_movemask_ps(reinterpret_cast<__m128>(lanes)));
#else
  lanes = (lanes < 0) & Int4{1, 2, 4, 8};
  return static_cast<unsigned>(lanes[0] | lanes[1] | lanes[2] | lanes[3]);
#endif
}

Float4 least_of(Float4 a, Float4 b) { return a < b ? a : b; }
Float4 most_of(Float4 a, Float4 b) { return a > b ? a : b; }

/// How many of four bits are set.
unsigned count_of(unsigned bits) { return 0x4332322132212110u >> (4 * bits) & 15; }

/// Rows become columns.
void transpose(Float4& a, Float4& b, Float4& c, Float4& d) {
  const Float4 ab_low = __builtin_shufflevector(a, b, 0, 4, 1, 5);
  const Float4 ab_high = __builtin_shufflevector(a, b, 2, 6, 3, 7);
  const Float4 cd_low = __builtin_shufflevector(c, d, 0, 4, 1, 5);
  const Float4 cd_high = __builtin_shufflevector(c, d, 2, 6, 3, 7);
  a = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
  b = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
  c = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
  d = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
}

// ------------------------------------------------------------ corners

constexpr int kLatticeBits = 11;
constexpr int kLattice = 1 << kLatticeBits;  ///< places per pixel
constexpr float kFar_px = 4096;              ///< from here on floats are coarser than the lattice
constexpr int kLargest_px = 512;             ///< what is larger would overflow 32 bits

/// Why a corner is not, or not plainly, in the picture.
constexpr std::int32_t kLeft = 1, kRight = 2, kAbove = 4, kBelow = 8, kNear = 16, kFarOut = 32;

/// A vertex in the picture. Floats, which hold places on the lattice exactly.
struct alignas(16) Corner {
  float u, v;  ///< on the lattice
  float inv_z;
  std::int32_t code;  ///< and kOne

  bool is(std::int32_t what) const { return (code & what) != 0; }
};
constexpr std::int32_t kOne = 0x3f800000;  ///< so that a code is no denormal number

struct Place {
  std::int64_t u = 0, v = 0;
};

int floor_pixel(std::int64_t lattice) { return static_cast<int>(lattice >> kLatticeBits); }
int ceil_pixel(std::int64_t lattice) {
  return static_cast<int>((lattice + kLattice - 1) >> kLatticeBits);
}

/// Maps vertices to the picture, four at a time.
class Projector {
 public:
  Projector(const RayGrid& grid, Vec3f origin) : origin_(origin) {
    const Camera& c = grid.camera;
    for (int i = 0; i < 3; ++i) {
      const Vec3d axis = grid.T_world_camera.rotation.column(i);
      axes_[i] = vec_cast<float>(axis);
    }
    fx_ = static_cast<float>(c.fx), fy_ = static_cast<float>(c.fy);
    cx_ = static_cast<float>(c.cx), cy_ = static_cast<float>(c.cy);
    last_u_ = (c.width - 1) * kLattice, last_v_ = (c.height - 1) * kLattice;
  }

  void run(const Vec3f* points, std::size_t count, Corner* out) const {
    std::size_t i = 0;
    for (; i + 5 <= count; i += 4) four(points + i, out + i);  // reads one number of the fifth
    while (i < count) {
      const std::size_t some = std::min<std::size_t>(count - i, 4);
      std::array<Vec3f, 5> in{};
      std::array<Corner, 4> made;
      std::copy_n(points + i, some, in.begin());
      four(in.data(), made.data());
      std::copy_n(made.begin(), some, out + i);
      i += some;
    }
  }

 private:
  static Int4 rounded(Float4 x) {
    return __builtin_convertvector(x + (x < 0 ? all4(-0.5f) : all4(0.5f)), Int4);
  }

  void four(const Vec3f* points, Corner* out) const {
    Float4 x = load4<Float4>(points), y = load4<Float4>(points + 1);
    Float4 z = load4<Float4>(points + 2), unused = load4<Float4>(points + 3);
    transpose(x, y, z, unused);
    x -= origin_.x, y -= origin_.y, z -= origin_.z;
    const auto along = [&](int i) { return x * axes_[i].x + y * axes_[i].y + z * axes_[i].z; };
    const Float4 depth = along(2);
    const Int4 near = ~(depth >= static_cast<float>(kit::kNearPlane_m));  // also what is no number
    Float4 inv_z = 1.0f / (near ? all4(1.0f) : depth);
    const Float4 u = along(0) * fx_ * inv_z + cx_, v = along(1) * fy_ * inv_z + cy_;
    const Int4 far_out = ~((u < kFar_px) & (u > -kFar_px) & (v < kFar_px) & (v > -kFar_px));
    const auto limited = [](Float4 a) {
      a = a < kFar_px ? a : all4(kFar_px);
      return rounded((a > -kFar_px ? a : all4(-kFar_px)) * static_cast<float>(kLattice));
    };
    const Int4 at_u = limited(u), at_v = limited(v);
    Int4 code = ((at_u < 0) & kLeft) | ((at_u > last_u_) & kRight) | ((at_v < 0) & kAbove) |
                ((at_v > last_v_) & kBelow) | (far_out & kFarOut);
    code = (near ? all4(kNear) : code) | kOne;
    Float4 a = __builtin_convertvector(at_u, Float4), b = __builtin_convertvector(at_v, Float4);
    Float4 d = load4<Float4>(&code);
    transpose(a, b, inv_z, d);
    std::memcpy(out, &a, 16), std::memcpy(out + 1, &b, 16);
    std::memcpy(out + 2, &inv_z, 16), std::memcpy(out + 3, &d, 16);
  }

  Vec3f origin_;
  std::array<Vec3f, 3> axes_;
  float fx_, fy_, cx_, cy_;
  std::int32_t last_u_, last_v_;
};

// ------------------------------------------------------------ triangles

/// A triangle in the picture, wound the positive way: its corners' u, v and 1 / depth, and the
/// pixels that it may cover, last included.
struct alignas(16) Shape {
  std::array<float, 3> a;
  std::uint32_t triangle_and_wide;  ///< the highest bit: 16 pixels or more across
  std::array<float, 3> b;
  std::int16_t left, top;
  std::array<float, 3> c;
  std::int16_t right, bottom;

  std::uint32_t triangle() const { return triangle_and_wide & 0x7fffffffu; }
  bool wide() const { return triangle_and_wide >> 31 != 0; }
};

/// A triangle that reaches the near plane or far beyond the picture, or is very large. A piece of
/// one: clipped at the near plane it may be two.
struct Rare {
  std::array<Place, 3> corners;
  double at_origin, per_x, per_y;  ///< 1 / depth over the picture
  float nearest, farthest;         ///< limits of it
  std::uint32_t triangle;
  int top, bottom;
};

/// The picture is drawn in tiles, whose images stay in the nearer caches.
constexpr int kColumnBits = 7, kRowBits = 5;
constexpr int kTileColumns = 1 << kColumnBits, kTileRows = 1 << kRowBits;

struct Tiles {
  int across = 0, down = 0;

  explicit Tiles(const Camera& camera)
      : across((camera.width + kTileColumns - 1) >> kColumnBits),
        down((camera.height + kTileRows - 1) >> kRowBits) {}
  std::size_t count() const { return static_cast<std::size_t>(across) * down; }
};

/// What became of the triangles of one range in one camera's picture.
struct Block {
  std::uint32_t part = 0, first = 0, count = 0;  ///< triangles of the part
  std::vector<Shape> shapes;
  std::vector<std::uint32_t> first_in;  ///< [tiles + 1] tile → its first place in `in_tile`
  std::vector<std::uint16_t> in_tile;   ///< shapes, tile by tile, ascending
  std::vector<std::uint32_t> rare;      ///< triangles of the part

  std::span<const std::uint16_t> shapes_in(std::size_t tile) const {
    return {in_tile.data() + first_in[tile], in_tile.data() + first_in[tile + 1]};
  }
};

/// Calls work(tile) for each tile that a shape may lie in.
template <typename Work>
void for_each_tile(const Shape& s, const Tiles& tiles, Work&& work) {
  const int left = s.left >> kColumnBits, right = s.right >> kColumnBits;
  const int top = s.top >> kRowBits, bottom = s.bottom >> kRowBits;
  if ((left == right) & (top == bottom)) return work(top * tiles.across + left);  // most
  for (int y = top; y <= bottom; ++y)
    for (int x = left; x <= right; ++x) work(y * tiles.across + x);
}

/// Finds the triangles of a block that cover pixels.
void find_shapes(const Mesh& mesh, const Corner* corners, std::uint32_t first_of_part,
                 const Camera& camera, Block& block) {
  block.shapes.clear(), block.rare.clear();
  block.shapes.reserve(block.count);
  const Int4 end{camera.width - 1, camera.height - 1, 0, 0};
  for (std::uint32_t t = block.first; t < block.first + block.count; ++t) {
    const Triangle& ids = mesh.triangles[t];
    const auto a = load4<Float4>(&corners[ids[0]]), b = load4<Float4>(&corners[ids[2]]);
    const auto c = load4<Float4>(&corners[ids[1]]);
    const Int4 code_a = load4<Int4>(&a), code_b = load4<Int4>(&b), code_c = load4<Int4>(&c);
    if (((code_a & code_b & code_c)[3] & ~kOne) != 0) continue;
    if (((code_a | code_b | code_c)[3] & (kNear | kFarOut)) != 0) {
      block.rare.push_back(t);
      continue;
    }
    const Float4 low = least_of(least_of(a, b), c), high = most_of(most_of(a, b), c);
    Int4 first = (__builtin_convertvector(low, Int4) + (kLattice - 1)) >> kLatticeBits;
    Int4 last = __builtin_convertvector(high, Int4) >> kLatticeBits;
    first = first > 0 ? first : all4(0);
    last = last < end ? last : end;
    const Float4 ab = b - a, ac = c - a;
    const bool backwards = double{ab[0]} * ac[1] <= double{ac[0]} * ab[1];
    if (((signs(first > last) & 3u) != 0) | backwards) continue;
    const Float4 across = high - low;
    if ((signs(across > static_cast<float>(kLargest_px * kLattice)) & 3u) != 0) {
      block.rare.push_back(t);
      continue;
    }
    const bool wide = (signs(across > 32767.0f) & 3u) != 0;
    const auto i16 = [](int x) { return static_cast<std::int16_t>(x); };
    block.shapes.push_back({{a[0], a[1], a[2]},
                            (first_of_part + t) | static_cast<std::uint32_t>(wide) << 31,
                            {b[0], b[1], b[2]},
                            i16(first[0]),
                            i16(first[1]),
                            {c[0], c[1], c[2]},
                            i16(last[0]),
                            i16(last[1])});
  }
}

/// Notes which tiles a block's shapes lie in.
void sort_into_tiles(const Tiles& tiles, Block& block) {
  block.first_in.assign(tiles.count() + 2, 0);
  std::uint32_t* count = block.first_in.data() + 2;
  for (const Shape& s : block.shapes) for_each_tile(s, tiles, [&](int tile) { ++count[tile]; });
  for (std::size_t i = 1; i < block.first_in.size(); ++i)
    block.first_in[i] += block.first_in[i - 1];
  block.in_tile.resize(block.first_in.back());
  std::uint32_t* next = block.first_in.data() + 1;  // filled, it has become the first of the next
  for (std::size_t i = 0; i < block.shapes.size(); ++i)
    for_each_tile(block.shapes[i], tiles,
                  [&](int tile) { block.in_tile[next[tile]++] = static_cast<std::uint16_t>(i); });
}

/// The line from p to q has the triangle on the side where this is not negative; a point on the
/// line is inside for one of its two directions.
std::int64_t beside(Place p, Place q, std::int64_t u, std::int64_t v) {
  const std::int64_t per_u = p.v - q.v, per_v = q.u - p.u;
  const bool other_way = per_u < 0 || (per_u == 0 && per_v < 0);
  return per_u * (u - p.u) + per_v * (v - p.v) - other_way;
}

/// The corners of a rare triangle, in order: vertices, camera frame, and as they were projected.
struct RareCorners {
  std::array<std::uint32_t, 3> ids;
  std::array<Vec3d, 3> points;
  std::array<Corner, 3> corners;
};

Place place_of(const Camera& camera, Vec3d p) {
  constexpr double kFarthestOut = 1 << 18;  // pixels: products fit 64 bits
  const kit::ScreenPoint s = kit::to_screen(camera, p);
  const auto nearest = [=](double x) {
    return static_cast<std::int64_t>(
        std::llround(std::clamp(x, -kFarthestOut, kFarthestOut) * kLattice));
  };
  return {nearest(s.u), nearest(s.v)};
}

/// The triangle clipped at the near plane: none, three or four places.
std::vector<Place> clipped(const Camera& camera, const RareCorners& all) {
  std::vector<Place> out;
  for (int i = 0; i < 3; ++i) {
    const int k = (i + 1) % 3;
    const Corner& corner = all.corners[i];
    if (!corner.is(kNear))
      out.push_back(corner.is(kFarOut) ? place_of(camera, all.points[i])
                                       : Place{static_cast<std::int64_t>(corner.u),
                                               static_cast<std::int64_t>(corner.v)});
    if (corner.is(kNear) == all.corners[k].is(kNear)) continue;
    const bool ascending = all.ids[i] < all.ids[k];  // the same for both triangles at the edge
    const Vec3d a = all.points[ascending ? i : k], b = all.points[ascending ? k : i];
    const double share = std::clamp((kit::kNearPlane_m - a.z) / (b.z - a.z), 0.0, 1.0);
    Vec3d cut = a + (b - a) * share;
    cut.z = kit::kNearPlane_m;
    out.push_back(place_of(camera, cut));
  }
  return out;
}

/// Sets a rare one's 1 / depth; false where it is seen edge-on.
bool set_depth(const Camera& camera, const std::array<Vec3d, 3>& p, Rare& out) {
  const Vec3d n = cross(p[1] - p[0], p[2] - p[0]);
  const double scale = 1 / dot(n, p[0]);
  if (!std::isfinite(scale)) return false;
  out.per_x = scale * n.x / camera.fx, out.per_y = scale * n.y / camera.fy;
  out.at_origin = scale * n.z - out.per_x * camera.cx - out.per_y * camera.cy;
  const auto [low, high] = std::minmax({p[0].z, p[1].z, p[2].z});
  out.nearest = static_cast<float>(1 / std::max(low, kit::kNearPlane_m));
  out.farthest = static_cast<float>(1 / std::max(high, kit::kNearPlane_m));
  return true;
}

// ------------------------------------------------------------ one tile

/// A meeting as it is drawn: `entry` is the triangle's place in the tile's list. Its key is the
/// larger the nearer it is; of equal depths, that of the first triangle.
struct Drawn {
  std::uint32_t not_entry;
  float inv_z;

  std::uint32_t entry() const { return ~not_entry; }
};
static_assert(std::endian::native == std::endian::little);
std::uint64_t key_of(Drawn d) { return std::bit_cast<std::uint64_t>(d); }
Drawn drawn_of(std::uint64_t key) { return std::bit_cast<Drawn>(key); }

/// The image of a tile: four places per pixel, and a list for what does not fit.
class TileImage {
 public:
  static constexpr int kPlaces = 4;
  static constexpr int kStride = kTileColumns + 4;  ///< groups of four may begin anywhere

  TileImage() : counts_(kStride * kTileRows), places_(counts_.size() * kPlaces) {}

  void clear() {
    std::fill(counts_.begin(), counts_.end(), std::uint8_t{0});
    more_.clear();
  }

  /// Adds a triangle's meetings in four pixels from `pixel` on, where `bits` are set.
  void add(std::size_t pixel, unsigned bits, Float4 inv_z, std::uint32_t entry) {
    std::uint32_t counts;
    std::memcpy(&counts, &counts_[pixel], 4);
    if ((counts & 0x04040404u) != 0) return add_one_by_one(pixel, bits, inv_z, entry);
    // All four are written; those that are not counted will be overwritten.
    const Int4 z = load4<Int4>(&inv_z), e = all4(static_cast<std::int32_t>(~entry));
    const Int4 low = __builtin_shufflevector(e, z, 0, 4, 1, 5);
    const Int4 high = __builtin_shufflevector(e, z, 2, 6, 3, 7);
    Drawn* place = &places_[pixel * kPlaces];
    std::memcpy(place + (counts & 3), &low, 8);
    std::memcpy(place + kPlaces + (counts >> 8 & 3), reinterpret_cast<const char*>(&low) + 8, 8);
    std::memcpy(place + 2 * kPlaces + (counts >> 16 & 3), &high, 8);
    std::memcpy(place + 3 * kPlaces + (counts >> 24), reinterpret_cast<const char*>(&high) + 8, 8);
    counts += (bits * 0x00204081u) & 0x01010101u;  // bit i to byte i
    std::memcpy(&counts_[pixel], &counts, 4);
  }

  /// Calls pixel_work(column, row, meetings) for every pixel that has at least `least` of them;
  /// the meetings are in the order of drawing.
  template <typename PixelWork>
  void for_each_pixel(int columns, int rows, unsigned least, PixelWork&& pixel_work) {
    const auto by_pixel = [](const More& a, const More& b) { return a.pixel < b.pixel; };
    std::stable_sort(more_.begin(), more_.end(), by_pixel);
    std::size_t next = 0;
    for (int y = 0; y < rows; ++y)
      for (int x = 0; x < columns; ++x) {
        const std::size_t pixel = static_cast<std::size_t>(y) * kStride + x;
        const unsigned count = counts_[pixel];
        if (count < least) continue;
        const Drawn* drawn = &places_[pixel * kPlaces];
        if (count <= kPlaces) {
          pixel_work(x, y, std::span(drawn, count));
          continue;
        }
        many_.assign(drawn, drawn + kPlaces);
        for (; next < more_.size() && more_[next].pixel <= pixel; ++next)
          if (more_[next].pixel == pixel) many_.push_back(more_[next].drawn);
        pixel_work(x, y, std::span<const Drawn>(many_));
      }
  }

 private:
  struct More {
    std::uint32_t pixel;
    Drawn drawn;
  };

  void add_one_by_one(std::size_t pixel, unsigned bits, Float4 inv_z, std::uint32_t entry) {
    for (int i = 0; i < 4; ++i) {
      if ((bits >> i & 1) == 0) continue;
      std::uint8_t& count = counts_[pixel + i];
      if (count < kPlaces)
        places_[(pixel + i) * kPlaces + count] = {~entry, inv_z[i]};
      else
        more_.push_back({static_cast<std::uint32_t>(pixel + i), {~entry, inv_z[i]}});
      count = static_cast<std::uint8_t>(std::min(count + 1, kPlaces + 1));
    }
  }

  std::vector<std::uint8_t> counts_;  ///< [pixels] kPlaces + 1: more than that
  std::vector<Drawn> places_;
  std::vector<More> more_;
  std::vector<Drawn> many_;
};

/// A triangle in a tile, and what its rays said there.
struct Entry {
  Facing facing;
  std::uint32_t hits = 0, lost = 0;
};

/// A tile and what it hands on.
struct Tile {
  int left = 0, top = 0, columns = 0, rows = 0;
  std::vector<Entry> entries;            ///< block by block, then the rare ones
  std::vector<std::uint32_t> triangles;  ///< [entries]
  std::vector<std::uint32_t> first;      ///< [blocks + 1] block → its first entry
  std::vector<RayVerdict> verdicts;      ///< if asked for
  std::vector<std::uint32_t> per_pixel;  ///< how many of them, if asked for
};

/// A shape's lines: inside where at + per_x · x + per_y · y is negative for none of them, with x
/// and y counted from the first pixel that is drawn. [3]: nothing.
struct Lines {
  Int4 at, per_x, per_y;
};

Lines lines_of(const Shape& s, Float4 corner_u, Float4 corner_v, int left, int top) {
  const Int4 u = __builtin_convertvector(corner_u, Int4),
             v = __builtin_convertvector(corner_v, Int4);
  Lines out;
  out.per_x = v - __builtin_shufflevector(v, v, 1, 2, 0, 3);
  out.per_y = __builtin_shufflevector(u, u, 1, 2, 0, 3) - u;
#ifdef __SSE2__
  if (!s.wide()) {  // all numbers take 16 bits, and sums of two products 32
    const auto pairs = [](Int4 low, Int4 high) {
      return reinterpret_cast<__m128i>((low & 0xffff) | (high << 16));
    };
    const Int4 from_u = left * kLattice - u, from_v = top * kLattice - v;
    const __m128i sums = _mm_madd_epi16(pairs(out.per_x, out.per_y), pairs(from_u, from_v));
    const Int4 other_way = (out.per_x < 0) | ((out.per_x == 0) & (out.per_y < 0));  // -1
    out.at = (reinterpret_cast<Int4>(sums) + other_way) >> kLatticeBits;
    return out;
  }
#endif
  out.at = Int4{};
  for (int i = 0; i < 3; ++i) {
    const int k = i == 2 ? 0 : i + 1;
    const std::int64_t at = beside({u[i], v[i]}, {u[k], v[k]}, std::int64_t{left} * kLattice,
                                   std::int64_t{top} * kLattice);
    out.at[i] = static_cast<std::int32_t>(at >> kLatticeBits);
  }
  return out;
}

/// 1 / depth over the picture, which is linear: at the first pixel that is drawn, and its limits.
struct InverseDepth {
  float at, per_x, per_y, least, most;

  InverseDepth(Float4 a, Float4 b, Float4 c, int left, int top) {
    const Float4 ab = b - a, ac = c - a;
    const Float4 n =
        __builtin_shufflevector(ab, ab, 1, 2, 0, 0) * __builtin_shufflevector(ac, ac, 2, 0, 1, 1) -
        __builtin_shufflevector(ab, ab, 2, 0, 1, 1) * __builtin_shufflevector(ac, ac, 1, 2, 0, 0);
    const float scale = -1.0f / n[2];  // per place of the lattice
    at = a[2] + n[0] * scale * (static_cast<float>(left * kLattice) - a[0]) +
         n[1] * scale * (static_cast<float>(top * kLattice) - a[1]);
    per_x = n[0] * (scale * kLattice), per_y = n[1] * (scale * kLattice);
    least = least_of(least_of(a, b), c)[2], most = most_of(most_of(a, b), c)[2];
  }
  Float4 limited(Float4 inv_z) const {
    const Float4 inside = least_of(most_of(inv_z, all4(least)), all4(most));
    return reinterpret_cast<Float4>(reinterpret_cast<Int4>(inside) &
                                    static_cast<std::int32_t>(kInverseDepthBits));
  }
};

template <int kLane>
Int4 spread(Int4 lanes) {
  return __builtin_shufflevector(lanes, lanes, kLane, kLane, kLane, kLane);
}

/// A line of a shape, at four pixels of a row.
struct LineAt {
  Int4 at, per_row, per_four;

  LineAt(Int4 begin, Int4 per_x, Int4 per_y) : per_row(per_y) {
    const Int4 odd{0, -1, 0, -1}, high{0, 0, -1, -1}, two = per_x + per_x;
    at = begin + (per_x & odd) + (two & high);
    per_four = two + two;
  }
};

/// Draws what of a shape lies in a tile; returns how many rays met it.
std::uint32_t draw(const Shape& s, const Tile& tile, std::uint32_t entry, TileImage& image) {
  const int left = std::max<int>(s.left, tile.left), top = std::max<int>(s.top, tile.top);
  const int right = std::min<int>(s.right, tile.left + tile.columns - 1);
  const int bottom = std::min<int>(s.bottom, tile.top + tile.rows - 1);
  const auto numbers = [](const std::array<float, 3>& corner) {  // the fourth is none
    const Int4 bits = load4<Int4>(corner.data()) & Int4{-1, -1, -1, 0};
    return load4<Float4>(&bits);
  };
  const Float4 a = numbers(s.a), b = numbers(s.b), c = numbers(s.c);
  const InverseDepth depth(a, b, c, left, top);
  Float4 u = a, v = b, unused_z = c, unused{};
  transpose(u, v, unused_z, unused);
  const Lines lines = lines_of(s, u, v, left, top);
  LineAt one(spread<0>(lines.at), spread<0>(lines.per_x), spread<0>(lines.per_y));
  LineAt two(spread<1>(lines.at), spread<1>(lines.per_x), spread<1>(lines.per_y));
  LineAt three(spread<2>(lines.at), spread<2>(lines.per_x), spread<2>(lines.per_y));
  Float4 row_inv_z = depth.at + Float4{0, 1, 2, 3} * depth.per_x;
  std::size_t pixel =
      static_cast<std::size_t>(top - tile.top) * TileImage::kStride + (left - tile.left);
  const int width = right - left + 1;
  std::uint32_t hits = 0;
  const unsigned wanted = 15u >> std::max(4 - width, 0);
  for (int y = top; y <= bottom; ++y, pixel += TileImage::kStride) {
    const unsigned bits = ~signs(one.at | two.at | three.at) & wanted;
    image.add(pixel, bits, depth.limited(row_inv_z), entry);
    hits += count_of(bits);
    if (width > 4) {
      Int4 at1 = one.at, at2 = two.at, at3 = three.at;
      Float4 inv_z = row_inv_z;
      for (int x = 4; x < width; x += 4) {
        at1 += one.per_four, at2 += two.per_four, at3 += three.per_four;
        inv_z += 4 * depth.per_x;
        const unsigned more = ~signs(at1 | at2 | at3) & (15u >> std::max(x + 4 - width, 0));
        if (more != 0) image.add(pixel + x, more, depth.limited(inv_z), entry);
        hits += count_of(more);
      }
    }
    one.at += one.per_row, two.at += two.per_row, three.at += three.per_row;
    row_inv_z += depth.per_y;
  }
  return hits;
}

/// The same for a rare one: the pixels of each row by division, in 64 bits.
std::uint32_t draw(const Rare& s, const Tile& tile, std::uint32_t entry, TileImage& image) {
  const auto floor_div = [](std::int64_t a, std::int64_t b) {  // b > 0
    return a >= 0 ? a / b : -((-a + b - 1) / b);
  };
  std::uint32_t hits = 0;
  const int bottom = std::min(s.bottom, tile.top + tile.rows - 1);
  for (int y = std::max(s.top, tile.top); y <= bottom; ++y) {
    std::int64_t first = tile.left, last = tile.left + tile.columns - 1;
    for (int i = 0; i < 3; ++i) {
      const Place p = s.corners[i], q = s.corners[(i + 1) % 3];
      const std::int64_t at = beside(p, q, 0, std::int64_t{y} * kLattice) >> kLatticeBits;
      const std::int64_t per_x = p.v - q.v;  // inside where at + per_x · x is not negative
      if (per_x > 0)
        first = std::max(first, -floor_div(at, per_x));
      else if (per_x < 0)
        last = std::min(last, floor_div(at, -per_x));
      else if (at < 0)
        last = -1;
    }
    const std::size_t row = static_cast<std::size_t>(y - tile.top) * TileImage::kStride;
    for (std::int64_t x = first; x <= last; x += 4) {
      Float4 inv_z;
      for (int i = 0; i < 4; ++i) {
        const double at = s.at_origin + s.per_x * static_cast<double>(x + i) + s.per_y * y;
        inv_z[i] = comparable(std::clamp(static_cast<float>(at), s.farthest, s.nearest));
      }
      const auto some = static_cast<unsigned>(std::min<std::int64_t>(last - x + 1, 4));
      image.add(row + static_cast<std::size_t>(x - tile.left), (1u << some) - 1, inv_z, entry);
      hits += some;
    }
  }
  return hits;
}

/// Decides the rays of a tile and counts what is lost there.
class Judge {
 public:
  Judge(const PaperField& field, const RayPencil& rays, Tile& tile)
      : field_(field), rays_(rays), tile_(tile) {}

  /// As many() does it, without branches.
  void two(Vec3f ray, Drawn a, Drawn b) {
    put_in_order(a, b);
    entry(b).lost += same(a, b, ray, dot(ray, ray));
  }

  void three(Vec3f ray, Drawn a, Drawn b, Drawn c) {
    put_in_order(a, b), put_in_order(b, c), put_in_order(a, b);
    const float stretch2 = dot(ray, ray);
    const bool a_takes_b = same(a, b, ray, stretch2);
    const bool one_part = entry(b).facing.part == entry(c).facing.part;
    const bool a_takes_c = same(a, c, ray, stretch2) & !(a_takes_b & one_part);
    const bool b_takes_c = same(b, c, ray, stretch2) & !a_takes_b;
    entry(b).lost += a_takes_b;
    entry(c).lost += a_takes_c | b_takes_c;
  }

  void many(Vec3f ray, std::span<const Drawn> drawn) {
    sorted_.clear();
    for (const Drawn& d : drawn) sorted_.push_back(key_of(d));
    if (drawn.size() <= kFew)
      for (std::size_t i = 1; i < sorted_.size(); ++i)
        for (std::size_t k = i; k > 0 && sorted_[k] > sorted_[k - 1]; --k)
          std::swap(sorted_[k - 1], sorted_[k]);
    else
      std::sort(sorted_.begin(), sorted_.end(), std::greater<>());
    on_ray_.clear();
    for (const std::uint64_t key : sorted_) {
      const Drawn d = drawn_of(key);
      on_ray_.push_back({1 / d.inv_z, tile_.triangles[d.entry()], false});
    }
    decide(on_ray_, field_, ray);
    for (std::size_t i = 0; i < sorted_.size(); ++i)
      entry(drawn_of(sorted_[i])).lost += on_ray_[i].lost;
  }

  /// Writes down what many() just decided.
  void tell() {
    std::sort(on_ray_.begin(), on_ray_.end(),
              [](const RayMeeting& a, const RayMeeting& b) { return a.triangle < b.triangle; });
    for (const RayMeeting& m : on_ray_) tile_.verdicts.push_back({m.triangle, m.lost});
    tile_.per_pixel.push_back(static_cast<std::uint32_t>(on_ray_.size()));
  }

  /// Through a pixel of the tile.
  Vec3f ray(int x, int y) const { return rays_.at(x + tile_.left, y + tile_.top); }

 private:
  static constexpr std::size_t kFew = 16;

  static void put_in_order(Drawn& a, Drawn& b) {
    const std::uint64_t one = key_of(a), other = key_of(b);
    const std::uint64_t swap = (one ^ other) & (std::uint64_t{0} - (one < other));  // no branch
    a = drawn_of(one ^ swap), b = drawn_of(other ^ swap);
  }
  Entry& entry(const Drawn& d) { return tile_.entries[d.entry()]; }
  bool same(const Drawn& a, const Drawn& b, Vec3f ray, float stretch2) {
    return same_surface(entry(a).facing, entry(b).facing, 1 / b.inv_z - 1 / a.inv_z, ray, stretch2);
  }

  const PaperField& field_;
  RayPencil rays_;
  Tile& tile_;
  std::vector<std::uint64_t> sorted_;  ///< keys
  std::vector<RayMeeting> on_ray_;
};

}  // namespace

// ------------------------------------------------------------ the whole picture

struct LayerCaster::Impl {
  static constexpr std::uint32_t kBlock = 4096;  ///< triangles; places in it take 16 bits
  explicit Impl(const PaperField& f) : field(f) {}

  const PaperField& field;
  std::vector<std::vector<Corner>> corners;  ///< [parts], of those that are drawn
  std::vector<Block> blocks;
  std::size_t used_blocks = 0;
  std::vector<Rare> rare;
  std::vector<Tile> tiles;
  std::size_t used_tiles = 0;
  std::mutex images_lock;
  std::vector<std::unique_ptr<TileImage>> images;

  void plan(const Camera& camera, std::span<const std::uint32_t> parts);
  void project(const RayGrid& grid, std::span<const std::uint32_t> parts);
  void sort(const Camera& camera);
  void add_rare(const RayGrid& grid);
  void add_rare(const RayGrid& grid, std::uint32_t part, std::uint32_t triangle);
  void draw_tile(std::size_t number, TileImage& image);
  void judge_tile(const RayGrid& grid, Tile& tile, TileImage& image, bool tell);
  void draw_tiles(const RayGrid& grid, bool tell);
  RayVerdicts verdicts(const Camera& camera) const;
  void count(RayVotes& votes);
};

/// Divides the parts into blocks and the picture into tiles.
void LayerCaster::Impl::plan(const Camera& camera, std::span<const std::uint32_t> parts) {
  const Tiles grid(camera);
  used_tiles = grid.count();
  if (tiles.size() < used_tiles) tiles.resize(used_tiles);
  for (std::size_t i = 0; i < used_tiles; ++i) {
    Tile& tile = tiles[i];
    tile.left = static_cast<int>(i % grid.across) * kTileColumns;
    tile.top = static_cast<int>(i / grid.across) * kTileRows;
    tile.columns = std::min(kTileColumns, camera.width - tile.left);
    tile.rows = std::min(kTileRows, camera.height - tile.top);
  }
  used_blocks = 0;
  for (const std::uint32_t part : parts) {
    const auto triangles = static_cast<std::uint32_t>(field.parts[part].mesh.triangles.size());
    for (std::uint32_t first = 0; first < triangles; first += kBlock) {
      if (blocks.size() == used_blocks) blocks.emplace_back();
      Block& block = blocks[used_blocks++];
      block.part = part, block.first = first, block.count = std::min(kBlock, triangles - first);
    }
  }
}

void LayerCaster::Impl::project(const RayGrid& grid, std::span<const std::uint32_t> parts) {
  constexpr std::size_t kGrain = 8192;
  const Projector projector(grid, RayPencil(grid).origin);
  corners.resize(field.parts.size());
  for (const std::uint32_t part : parts) {
    const std::vector<Vec3f>& points = field.parts[part].mesh.positions;
    std::vector<Corner>& out = corners[part];
    if (out.size() < points.size()) out.resize(points.size());
    parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      projector.run(points.data() + begin, end - begin, out.data() + begin);
    });
  }
}

void LayerCaster::Impl::sort(const Camera& camera) {
  parallel_for(used_blocks, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Block& block = blocks[i];
      find_shapes(field.parts[block.part].mesh, corners[block.part].data(), field.first[block.part],
                  camera, block);
      sort_into_tiles(Tiles(camera), block);
    }
  });
}

void LayerCaster::Impl::add_rare(const RayGrid& grid) {
  rare.clear();
  for (std::size_t i = 0; i < used_blocks; ++i)
    for (const std::uint32_t t : blocks[i].rare) add_rare(grid, blocks[i].part, t);
}

void LayerCaster::Impl::add_rare(const RayGrid& grid, std::uint32_t part, std::uint32_t triangle) {
  const Mesh& mesh = field.parts[part].mesh;
  const Triangle& ids = mesh.triangles[triangle];
  const Vec3d origin = vec_cast<double>(RayPencil(grid).origin);
  const Mat3 R_camera_world = transposed(grid.T_world_camera.rotation);
  RareCorners all;
  all.ids = {ids[0], ids[2], ids[1]};
  for (int i = 0; i < 3; ++i) {
    const Vec3f position = mesh.positions[all.ids[i]];
    if (!is_finite(position)) return;
    all.points[i] = R_camera_world * (vec_cast<double>(position) - origin);
    all.corners[i] = corners[part][all.ids[i]];
  }
  Rare out;
  out.triangle = field.first[part] + triangle;
  if (!set_depth(grid.camera, all.points, out)) return;
  const std::vector<Place> polygon = clipped(grid.camera, all);
  for (std::size_t i = 2; i < polygon.size(); ++i) {
    const Place a = polygon[0], b = polygon[i - 1], c = polygon[i];
    if ((b.u - a.u) * (c.v - a.v) <= (c.u - a.u) * (b.v - a.v)) continue;
    const auto [above, below] = std::minmax({a.v, b.v, c.v});
    out.corners = {a, b, c};
    out.top = std::max(ceil_pixel(above), 0);
    out.bottom = std::min(floor_pixel(below), grid.camera.height - 1);
    if (out.top <= out.bottom) rare.push_back(out);
  }
}

/// Draws all triangles that lie in a tile.
// Inside its caller, the compiler runs short of registers for it.
[[gnu::noinline]] void LayerCaster::Impl::draw_tile(std::size_t number, TileImage& image) {
  constexpr std::size_t kAhead = 12;
  Tile& tile = tiles[number];
  image.clear();
  std::size_t most = rare.size();
  for (std::size_t i = 0; i < used_blocks; ++i) most += blocks[i].shapes_in(number).size();
  tile.entries.resize(most), tile.triangles.resize(most), tile.first.assign(1, 0);
  std::uint32_t next = 0;
  const auto add = [&](std::uint32_t triangle, std::uint32_t hits) {
    tile.entries[next] = {field.facing[triangle], hits, 0};
    tile.triangles[next++] = triangle;
  };
  for (std::size_t i = 0; i < used_blocks; ++i) {
    const std::span<const std::uint16_t> places = blocks[i].shapes_in(number);
    const Shape* shapes = blocks[i].shapes.data();
    for (std::size_t k = 0; k < places.size(); ++k) {
      if (k + kAhead < places.size()) {  // what is not in the nearest cache is waited for long
        __builtin_prefetch(&shapes[places[k + kAhead]]);
        __builtin_prefetch(&field.facing[shapes[places[k + kAhead / 2]].triangle()]);
      }
      const Shape& shape = shapes[places[k]];
      add(shape.triangle(), draw(shape, tile, next, image));
    }
    tile.first.push_back(next);
  }
  for (const Rare& one : rare)
    if (one.top < tile.top + tile.rows && one.bottom >= tile.top)
      add(one.triangle, draw(one, tile, next, image));
  tile.entries.resize(next);
}

void LayerCaster::Impl::judge_tile(const RayGrid& grid, Tile& tile, TileImage& image, bool tell) {
  tile.verdicts.clear(), tile.per_pixel.clear();
  Judge judge(field, RayPencil(grid), tile);
  if (tell)
    return image.for_each_pixel(tile.columns, tile.rows, 0,
                                [&](int x, int y, std::span<const Drawn> drawn) {
                                  judge.many(judge.ray(x, y), drawn), judge.tell();
                                });
  image.for_each_pixel(tile.columns, tile.rows, 2, [&](int x, int y, std::span<const Drawn> drawn) {
    if (drawn.size() == 2)
      judge.two(judge.ray(x, y), drawn[0], drawn[1]);
    else if (drawn.size() == 3)
      judge.three(judge.ray(x, y), drawn[0], drawn[1], drawn[2]);
    else
      judge.many(judge.ray(x, y), drawn);
  });
}

void LayerCaster::Impl::draw_tiles(const RayGrid& grid, bool tell) {
  parallel_for(used_tiles, 1, [&](std::size_t begin, std::size_t end) {
    std::unique_ptr<TileImage> image;
    {
      const std::scoped_lock lock(images_lock);
      if (!images.empty()) image = std::move(images.back()), images.pop_back();
    }
    if (!image) image = std::make_unique<TileImage>();
    for (std::size_t i = begin; i < end; ++i)
      draw_tile(i, *image), judge_tile(grid, tiles[i], *image, tell);
    const std::scoped_lock lock(images_lock);
    images.push_back(std::move(image));
  });
}

/// What all tiles were told, as one picture.
RayVerdicts LayerCaster::Impl::verdicts(const Camera& camera) const {
  RayVerdicts out{camera.width, camera.height, {}, {}};
  out.first.assign(static_cast<std::size_t>(camera.width) * camera.height + 1, 0);
  const auto for_each_pixel = [&](auto&& work) {
    for (std::size_t t = 0; t < used_tiles; ++t)
      for (std::size_t i = 0; i < tiles[t].per_pixel.size(); ++i) {
        const int x = tiles[t].left + static_cast<int>(i) % tiles[t].columns;
        const int y = tiles[t].top + static_cast<int>(i) / tiles[t].columns;
        work(tiles[t], i, static_cast<std::size_t>(y) * camera.width + x);
      }
  };
  for_each_pixel([&](const Tile& tile, std::size_t i, std::size_t pixel) {
    out.first[pixel + 1] = tile.per_pixel[i];
  });
  std::partial_sum(out.first.begin(), out.first.end(), out.first.begin());
  out.verdicts.resize(out.first.back());
  const RayVerdict* from = nullptr;
  for_each_pixel([&](const Tile& tile, std::size_t i, std::size_t pixel) {
    if (i == 0) from = tile.verdicts.data();
    std::copy_n(from, tile.per_pixel[i], out.verdicts.begin() + out.first[pixel]);
    from += tile.per_pixel[i];
  });
  return out;
}

void LayerCaster::Impl::count(RayVotes& votes) {
  const auto add = [&](const Tile& tile, std::size_t entry) {
    votes.hits[tile.triangles[entry]] += tile.entries[entry].hits;
    votes.lost[tile.triangles[entry]] += tile.entries[entry].lost;
  };
  parallel_for(used_blocks, 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t t = 0; t < used_tiles; ++t)
        for (std::uint32_t e = tiles[t].first[i]; e < tiles[t].first[i + 1]; ++e) add(tiles[t], e);
  });
  for (std::size_t t = 0; t < used_tiles; ++t)
    for (std::size_t e = tiles[t].first.back(); e < tiles[t].entries.size(); ++e) add(tiles[t], e);
}

LayerCaster::LayerCaster(const PaperField& field) : impl_(std::make_unique<Impl>(field)) {}
LayerCaster::~LayerCaster() = default;

void LayerCaster::cast(const RayGrid& grid, std::span<const std::uint32_t> parts, RayVotes& votes,
                       RayVerdicts* told) {
  const Camera& camera = grid.camera;
  MR_ASSERT(camera.model == CameraModel::pinhole && camera.distortion == DistortionModel::none);
  Impl& m = *impl_;
  m.plan(camera, parts);
  m.project(grid, parts);
  m.sort(camera);
  m.add_rare(grid);
  m.draw_tiles(grid, told != nullptr);
  m.count(votes);
  if (told) *told = m.verdicts(camera);
}

}  // namespace mr::merge
