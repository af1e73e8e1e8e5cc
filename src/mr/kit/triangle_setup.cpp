#include "mr/kit/triangle_setup.h"

#include <algorithm>
#include <cmath>

#include "mr/kit/raster.h"

namespace mr::kit {
namespace {

constexpr float kFarOut_px = 4096;  ///< from here on floats are coarser than the subpixel grid
constexpr int kLargestOnScreen_px = 512;  ///< larger triangles would overflow 32 bits

int floor_pixel(std::int64_t subpixel) { return static_cast<int>(subpixel >> kSubpixelBits); }
int ceil_pixel(std::int64_t subpixel) {
  return static_cast<int>((subpixel + kSubpixels - 1) >> kSubpixelBits);
}

class VertexProjector {
 public:
  explicit VertexProjector(const RasterView& view) : origin_(view.origin) {
    const Camera& c = *view.camera;
    for (int i = 0; i < 3; ++i) {
      const Vec3d axis = view.R_world_camera.column(i);
      axes_[i] = vec_cast<float>(axis);
    }
    fx_ = static_cast<float>(c.fx), fy_ = static_cast<float>(c.fy);
    cx_ = static_cast<float>(c.cx), cy_ = static_cast<float>(c.cy);
    last_u_ = (c.width - 1) * kSubpixels, last_v_ = (c.height - 1) * kSubpixels;
  }

  void four(const Vec3f* points, ProjectedVertex* out) const {
    Float4 x = load4<Float4>(&points[0].x), y = load4<Float4>(&points[1].x);
    Float4 z = load4<Float4>(&points[2].x), unused = load4<Float4>(&points[3].x);
    transpose(x, y, z, unused);
    x -= origin_.x, y -= origin_.y, z -= origin_.z;
    const auto along = [&](int i) { return x * axes_[i].x + y * axes_[i].y + z * axes_[i].z; };
    const Float4 depth = along(2);
    const Int4 near = ~(depth >= static_cast<float>(kNearPlane_m));  // also what is no number
    Float4 inv_z = 1.0f / (near ? splat4(1.0f) : depth);
    const Float4 u = along(0) * fx_ * inv_z + cx_, v = along(1) * fy_ * inv_z + cy_;
    const Int4 far_out =
        ~((u < kFarOut_px) & (u > -kFarOut_px) & (v < kFarOut_px) & (v > -kFarOut_px));
    const Int4 at_u = on_grid(u), at_v = on_grid(v);
    Int4 code = ((at_u < 0) & kLeftOf) | ((at_u > last_u_) & kRightOf) | ((at_v < 0) & kAbove) |
                ((at_v > last_v_) & kBelow) | (far_out & kFarOut);
    code = (near ? splat4(kTooNear) : code) | kOutcodeBase;
    Float4 a = __builtin_convertvector(at_u, Float4), b = __builtin_convertvector(at_v, Float4);
    Float4 d = as_floats(code);
    transpose(a, b, inv_z, d);
    store4(a, &out[0].u), store4(b, &out[1].u), store4(inv_z, &out[2].u), store4(d, &out[3].u);
  }

 private:
  static Int4 on_grid(Float4 a) {
    a = a < kFarOut_px ? a : splat4(kFarOut_px);
    a = (a > -kFarOut_px ? a : splat4(-kFarOut_px)) * static_cast<float>(kSubpixels);
    return __builtin_convertvector(a + (a < 0 ? splat4(-0.5f) : splat4(0.5f)), Int4);
  }

  Vec3f origin_;
  std::array<Vec3f, 3> axes_;
  float fx_, fy_, cx_, cy_;
  std::int32_t last_u_, last_v_;
};

/// Calls work(tile) for each tile that a triangle may lie in.
template <typename Work>
void for_each_tile(const ScreenTriangle& s, const TileGrid& tiles, Work&& work) {
  const int left = s.left >> kTileColumnBits, right = s.right >> kTileColumnBits;
  const int top = s.top >> kTileRowBits, bottom = s.bottom >> kTileRowBits;
  if ((left == right) & (top == bottom)) return work(top * tiles.across + left);  // most
  for (int y = top; y <= bottom; ++y)
    for (int x = left; x <= right; ++x) work(y * tiles.across + x);
}

/// The corners of a triangle to clip: vertices, camera frame, and as they were projected.
struct ClipCorners {
  std::array<std::uint32_t, 3> ids;
  std::array<Vec3d, 3> points;
  std::array<ProjectedVertex, 3> projected;
};

SubpixelPoint project_far_out(const Camera& camera, Vec3d p) {
  constexpr double kFarthest_px = 1 << 18;  // products fit 64 bits
  const ScreenPoint s = to_screen(camera, p);
  const auto nearest = [=](double x) {
    return static_cast<std::int64_t>(
        std::llround(std::clamp(x, -kFarthest_px, kFarthest_px) * kSubpixels));
  };
  return {nearest(s.u), nearest(s.v)};
}

/// The triangle clipped at the near plane: none, three or four corners.
std::vector<SubpixelPoint> clip_at_near_plane(const Camera& camera, const ClipCorners& all) {
  std::vector<SubpixelPoint> out;
  for (int i = 0; i < 3; ++i) {
    const int k = (i + 1) % 3;
    const ProjectedVertex& corner = all.projected[i];
    if (!corner.is(kTooNear))
      out.push_back(corner.is(kFarOut) ? project_far_out(camera, all.points[i])
                                       : SubpixelPoint{static_cast<std::int64_t>(corner.u),
                                                       static_cast<std::int64_t>(corner.v)});
    if (corner.is(kTooNear) == all.projected[k].is(kTooNear)) continue;
    const bool ascending = all.ids[i] < all.ids[k];  // the same for both triangles at the edge
    const Vec3d a = all.points[ascending ? i : k], b = all.points[ascending ? k : i];
    const double share = std::clamp((kNearPlane_m - a.z) / (b.z - a.z), 0.0, 1.0);
    Vec3d cut = a + (b - a) * share;
    cut.z = kNearPlane_m;
    out.push_back(project_far_out(camera, cut));
  }
  return out;
}

/// Sets 1 / depth of a clipped triangle; false where it is seen edge-on.
bool set_depth(const Camera& camera, const std::array<Vec3d, 3>& p, ClippedTriangle& out) {
  const Vec3d n = cross(p[1] - p[0], p[2] - p[0]);
  const double scale = 1 / dot(n, p[0]);
  if (!std::isfinite(scale)) return false;
  out.per_x = scale * n.x / camera.fx, out.per_y = scale * n.y / camera.fy;
  out.at_origin = scale * n.z - out.per_x * camera.cx - out.per_y * camera.cy;
  const auto [low, high] = std::minmax({p[0].z, p[1].z, p[2].z});
  out.nearest = static_cast<float>(1 / std::max(low, kNearPlane_m));
  out.farthest = static_cast<float>(1 / std::max(high, kNearPlane_m));
  return true;
}

}  // namespace

void project_vertices(const RasterView& view, std::span<const Vec3f> points, ProjectedVertex* out) {
  const VertexProjector projector(view);
  const std::size_t count = points.size();
  std::size_t i = 0;
  for (; i + 5 <= count; i += 4)
    projector.four(points.data() + i, out + i);  // reads one number of the fifth
  while (i < count) {
    const std::size_t some = std::min<std::size_t>(count - i, 4);
    std::array<Vec3f, 5> in{};
    std::array<ProjectedVertex, 4> projected;
    std::copy_n(points.data() + i, some, in.begin());
    projector.four(in.data(), projected.data());
    std::copy_n(projected.begin(), some, out + i);
    i += some;
  }
}

void set_up_triangles(const Mesh& mesh, const ProjectedVertex* vertices,
                      std::uint32_t first_of_mesh, const Camera& camera, TriangleBlock& block) {
  block.on_screen.clear(), block.to_clip.clear();
  block.on_screen.reserve(block.count);
  const Int4 end{camera.width - 1, camera.height - 1, 0, 0};
  for (std::uint32_t t = block.first; t < block.first + block.count; ++t) {
    const Triangle& ids = mesh.triangles[t];
    const auto a = load4<Float4>(&vertices[ids[0]].u), b = load4<Float4>(&vertices[ids[2]].u);
    const auto c = load4<Float4>(&vertices[ids[1]].u);
    const Int4 code_a = as_ints(a), code_b = as_ints(b), code_c = as_ints(c);
    if (((code_a & code_b & code_c)[3] & ~kOutcodeBase) != 0) continue;
    if (((code_a | code_b | code_c)[3] & (kTooNear | kFarOut)) != 0) {
      block.to_clip.push_back(t);
      continue;
    }
    const Float4 low = min4(min4(a, b), c), high = max4(max4(a, b), c);
    Int4 first = (__builtin_convertvector(low, Int4) + (kSubpixels - 1)) >> kSubpixelBits;
    Int4 last = __builtin_convertvector(high, Int4) >> kSubpixelBits;
    first = first > 0 ? first : splat4(0);
    last = last < end ? last : end;
    const Float4 ab = b - a, ac = c - a;
    const bool backwards = double{ab[0]} * ac[1] <= double{ac[0]} * ab[1];
    if (((sign_bits(first > last) & 3u) != 0) | backwards) continue;
    const Float4 across = high - low;
    if ((sign_bits(across > static_cast<float>(kLargestOnScreen_px * kSubpixels)) & 3u) != 0) {
      block.to_clip.push_back(t);
      continue;
    }
    const bool wide = (sign_bits(across > 32767.0f) & 3u) != 0;
    const auto i16 = [](int x) { return static_cast<std::int16_t>(x); };
    block.on_screen.push_back({{a[0], a[1], a[2]},
                               (first_of_mesh + t) | static_cast<std::uint32_t>(wide) << 31,
                               {b[0], b[1], b[2]},
                               i16(first[0]),
                               i16(first[1]),
                               {c[0], c[1], c[2]},
                               i16(last[0]),
                               i16(last[1])});
  }
}

void sort_into_tiles(const TileGrid& tiles, TriangleBlock& block) {
  block.first_in.assign(tiles.count() + 2, 0);
  std::uint32_t* count = block.first_in.data() + 2;
  for (const ScreenTriangle& s : block.on_screen)
    for_each_tile(s, tiles, [&](int tile) { ++count[tile]; });
  for (std::size_t i = 1; i < block.first_in.size(); ++i)
    block.first_in[i] += block.first_in[i - 1];
  block.in_tile.resize(block.first_in.back());
  std::uint32_t* next = block.first_in.data() + 1;  // filled, it has become the first of the next
  for (std::size_t i = 0; i < block.on_screen.size(); ++i)
    for_each_tile(block.on_screen[i], tiles,
                  [&](int tile) { block.in_tile[next[tile]++] = static_cast<std::uint16_t>(i); });
}

void clip_triangle(const RasterView& view, const Mesh& mesh, const ProjectedVertex* vertices,
                   std::uint32_t triangle, std::uint32_t first_of_mesh,
                   std::vector<ClippedTriangle>& out) {
  const Camera& camera = *view.camera;
  const Triangle& ids = mesh.triangles[triangle];
  const Vec3d origin = vec_cast<double>(view.origin);
  const Mat3 R_camera_world = transposed(view.R_world_camera);
  ClipCorners all;
  all.ids = {ids[0], ids[2], ids[1]};
  for (int i = 0; i < 3; ++i) {
    const Vec3f position = mesh.positions[all.ids[i]];
    if (!is_finite(position)) return;
    all.points[i] = R_camera_world * (vec_cast<double>(position) - origin);
    all.projected[i] = vertices[all.ids[i]];
  }
  ClippedTriangle piece;
  piece.triangle = first_of_mesh + triangle;
  if (!set_depth(camera, all.points, piece)) return;
  const std::vector<SubpixelPoint> polygon = clip_at_near_plane(camera, all);
  for (std::size_t i = 2; i < polygon.size(); ++i) {
    const SubpixelPoint a = polygon[0], b = polygon[i - 1], c = polygon[i];
    if ((b.u - a.u) * (c.v - a.v) <= (c.u - a.u) * (b.v - a.v)) continue;
    const auto [above, below] = std::minmax({a.v, b.v, c.v});
    piece.corners = {a, b, c};
    piece.top = std::max(ceil_pixel(above), 0);
    piece.bottom = std::min(floor_pixel(below), camera.height - 1);
    if (piece.top <= piece.bottom) out.push_back(piece);
  }
}

}  // namespace mr::kit
