#include "mr/kit/tile_raster.h"

#include <algorithm>

namespace mr::kit {
namespace {

/// A triangle's three edge functions: inside where at + per_x · x + per_y · y is negative for none
/// of them, with x and y counted from the first pixel that is drawn. [3]: nothing.
struct EdgeFunctions {
  Int4 at, per_x, per_y;
};

EdgeFunctions edges_of(const ScreenTriangle& s, Float4 corner_u, Float4 corner_v, int left,
                       int top) {
  const Int4 u = __builtin_convertvector(corner_u, Int4),
             v = __builtin_convertvector(corner_v, Int4);
  EdgeFunctions out;
  out.per_x = v - __builtin_shufflevector(v, v, 1, 2, 0, 3);
  out.per_y = __builtin_shufflevector(u, u, 1, 2, 0, 3) - u;
#ifdef __SSE2__
  if (!s.wide()) {  // all numbers take 16 bits, and sums of two products 32
    const auto pairs = [](Int4 low, Int4 high) {
      return reinterpret_cast<__m128i>((low & 0xffff) | (high << 16));
    };
    const Int4 from_u = left * kSubpixels - u, from_v = top * kSubpixels - v;
    const __m128i sums = _mm_madd_epi16(pairs(out.per_x, out.per_y), pairs(from_u, from_v));
    const Int4 other_way = (out.per_x < 0) | ((out.per_x == 0) & (out.per_y < 0));  // -1
    out.at = (reinterpret_cast<Int4>(sums) + other_way) >> kSubpixelBits;
    return out;
  }
#endif
  out.at = Int4{};
  for (int i = 0; i < 3; ++i) {
    const int k = i == 2 ? 0 : i + 1;
    const std::int64_t at =
        edge_function({u[i], v[i]}, {u[k], v[k]}, std::int64_t{left} * kSubpixels,
                      std::int64_t{top} * kSubpixels);
    out.at[i] = static_cast<std::int32_t>(at >> kSubpixelBits);
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
    const float scale = -1.0f / n[2];  // per point of the subpixel grid
    at = a[2] + n[0] * scale * (static_cast<float>(left * kSubpixels) - a[0]) +
         n[1] * scale * (static_cast<float>(top * kSubpixels) - a[1]);
    per_x = n[0] * (scale * kSubpixels), per_y = n[1] * (scale * kSubpixels);
    least = min4(min4(a, b), c)[2], most = max4(max4(a, b), c)[2];
  }
  Float4 limited(Float4 inv_z) const {
    const Float4 inside = min4(max4(inv_z, splat4(least)), splat4(most));
    return as_floats(as_ints(inside) & static_cast<std::int32_t>(kInverseDepthBits));
  }
};

/// An edge function at four pixels of a row.
struct EdgeAtFour {
  Int4 at, per_row, per_four;

  EdgeAtFour(Int4 begin, Int4 per_x, Int4 per_y) : per_row(per_y) {
    const Int4 odd{0, -1, 0, -1}, high{0, 0, -1, -1}, two = per_x + per_x;
    at = begin + (per_x & odd) + (two & high);
    per_four = two + two;
  }
};

/// How many of four bits are set.
unsigned count_bits(unsigned bits) { return 0x4332322132212110u >> (4 * bits) & 15; }

}  // namespace

std::uint32_t draw(const ScreenTriangle& s, const RasterTile& tile, std::uint32_t entry,
                   ABuffer& buffer) {
  const int left = std::max<int>(s.left, tile.left), top = std::max<int>(s.top, tile.top);
  const int right = std::min<int>(s.right, tile.left + tile.columns - 1);
  const int bottom = std::min<int>(s.bottom, tile.top + tile.rows - 1);
  const auto numbers = [](const std::array<float, 3>& corner) {  // the fourth is none
    const Int4 bits = as_ints(load4<Float4>(corner.data())) & Int4{-1, -1, -1, 0};
    return as_floats(bits);
  };
  const Float4 a = numbers(s.a), b = numbers(s.b), c = numbers(s.c);
  const InverseDepth depth(a, b, c, left, top);
  Float4 u = a, v = b, unused_z = c, unused{};
  transpose(u, v, unused_z, unused);
  const EdgeFunctions edges = edges_of(s, u, v, left, top);
  EdgeAtFour one(broadcast<0>(edges.at), broadcast<0>(edges.per_x), broadcast<0>(edges.per_y));
  EdgeAtFour two(broadcast<1>(edges.at), broadcast<1>(edges.per_x), broadcast<1>(edges.per_y));
  EdgeAtFour three(broadcast<2>(edges.at), broadcast<2>(edges.per_x), broadcast<2>(edges.per_y));
  Float4 row_inv_z = depth.at + Float4{0, 1, 2, 3} * depth.per_x;
  std::size_t pixel =
      static_cast<std::size_t>(top - tile.top) * ABuffer::kStride + (left - tile.left);
  const int width = right - left + 1;
  std::uint32_t covered = 0;
  const unsigned wanted = 15u >> std::max(4 - width, 0);
  for (int y = top; y <= bottom; ++y, pixel += ABuffer::kStride) {
    const unsigned bits = ~sign_bits(one.at | two.at | three.at) & wanted;
    buffer.add(pixel, bits, depth.limited(row_inv_z), entry);
    covered += count_bits(bits);
    if (width > 4) {
      Int4 at1 = one.at, at2 = two.at, at3 = three.at;
      Float4 inv_z = row_inv_z;
      for (int x = 4; x < width; x += 4) {
        at1 += one.per_four, at2 += two.per_four, at3 += three.per_four;
        inv_z += 4 * depth.per_x;
        const unsigned more = ~sign_bits(at1 | at2 | at3) & (15u >> std::max(x + 4 - width, 0));
        if (more != 0) buffer.add(pixel + x, more, depth.limited(inv_z), entry);
        covered += count_bits(more);
      }
    }
    one.at += one.per_row, two.at += two.per_row, three.at += three.per_row;
    row_inv_z += depth.per_y;
  }
  return covered;
}

/// The same for a clipped one: the pixels of each row by division, in 64 bits.
std::uint32_t draw(const ClippedTriangle& s, const RasterTile& tile, std::uint32_t entry,
                   ABuffer& buffer) {
  const auto floor_div = [](std::int64_t a, std::int64_t b) {  // b > 0
    return a >= 0 ? a / b : -((-a + b - 1) / b);
  };
  std::uint32_t covered = 0;
  const int bottom = std::min(s.bottom, tile.top + tile.rows - 1);
  for (int y = std::max(s.top, tile.top); y <= bottom; ++y) {
    std::int64_t first = tile.left, last = tile.left + tile.columns - 1;
    for (int i = 0; i < 3; ++i) {
      const SubpixelPoint p = s.corners[i], q = s.corners[(i + 1) % 3];
      const std::int64_t at = edge_function(p, q, 0, std::int64_t{y} * kSubpixels) >> kSubpixelBits;
      const std::int64_t per_x = p.v - q.v;  // inside where at + per_x · x is not negative
      if (per_x > 0)
        first = std::max(first, -floor_div(at, per_x));
      else if (per_x < 0)
        last = std::min(last, floor_div(at, -per_x));
      else if (at < 0)
        last = -1;
    }
    const std::size_t row = static_cast<std::size_t>(y - tile.top) * ABuffer::kStride;
    for (std::int64_t x = first; x <= last; x += 4) {
      Float4 inv_z;
      for (int i = 0; i < 4; ++i) {
        const double at = s.at_origin + s.per_x * static_cast<double>(x + i) + s.per_y * y;
        inv_z[i] = comparable(std::clamp(static_cast<float>(at), s.farthest, s.nearest));
      }
      const auto some = static_cast<unsigned>(std::min<std::int64_t>(last - x + 1, 4));
      buffer.add(row + static_cast<std::size_t>(x - tile.left), (1u << some) - 1, inv_z, entry);
      covered += some;
    }
  }
  return covered;
}

}  // namespace mr::kit
