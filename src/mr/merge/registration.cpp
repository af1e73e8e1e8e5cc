#include "mr/merge/registration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/kit/raster.h"

#include "mr/merge/boxes.h"
#include "mr/merge/disjoint_sets.h"
#include "mr/merge/ray_grids.h"

namespace mr::merge {
namespace {

constexpr double kPixelsPerRad = 180, kPixelsPerRadAround = 125;  // of the pictures looked into
constexpr double kWindowRad = 0.008;                              // planes are fitted over twice it
constexpr std::size_t kSamples = 2048;                            // of a part
constexpr std::size_t kPartsForAll = 6;    // with so many neighbours each looks at every sample
constexpr std::size_t kLeastSamples = 64;  // that a part looks at in another
constexpr double kAlike = 0.87;            // cosine: normals within 30 degrees
constexpr double kFacing = 0.25;           // cosine towards a camera: not grazing
constexpr double kLeastShared_m2 = 0.1;
constexpr std::size_t kLeastMatches = 12;
constexpr double kLeastSharedArea = 0.85;  // shared of expected, of parts that agree
constexpr double kDegree = std::numbers::pi / 180;

// ---- What a part's sensors see of it

/// The part in a camera's picture.
struct View {
  Camera camera;
  Pose T_camera_world;
  int window_px = 1;
  ImageDepth inverse_depth;  // 1 / m, 0: nothing
};

struct Sample {
  Vec3d position, normal;
};

/// A part, ready to be compared with others.
struct Surface {
  std::vector<View> views;
  std::vector<Sample> samples;  // evenly by area, where a plane fits and a sensor sees it
  double sample_m2 = 0;         // that each stands for
  Box3f box;
  Vec3d eye;  // the middle of its sensors
};

/// A vertex in the picture.
struct DepthCorner {
  float u, v, inverse_z;  // inverse_z 0: before the near plane
};

std::vector<DepthCorner> corners_of(const Mesh& mesh, const Camera& camera,
                                    const Pose& T_camera_world) {
  const Vec3f eye = vec_cast<float>(T_camera_world.inverse().translation);
  const auto row = [&](int i) { return vec_cast<float>(T_camera_world.rotation.row(i)); };
  const Vec3f x = row(0) * static_cast<float>(camera.fx),
              y = row(1) * static_cast<float>(camera.fy);
  const Vec3f z = row(2);
  const auto cx = static_cast<float>(camera.cx), cy = static_cast<float>(camera.cy);
  std::vector<DepthCorner> out;
  out.reserve(mesh.positions.size());
  for (const Vec3f position : mesh.positions) {
    const Vec3f p = position - eye;
    const float depth = dot(z, p);
    const float inverse = depth > static_cast<float>(kit::kNearPlane_m) ? 1 / depth : 0;
    out.push_back({dot(x, p) * inverse + cx, dot(y, p) * inverse + cy, inverse});
  }
  return out;
}

/// Keeps the nearest in every pixel of a triangle that faces the camera.
void draw(const DepthCorner& a, const DepthCorner& b, const DepthCorner& c, ImageDepth& picture) {
  const float area = (c.u - a.u) * (b.v - a.v) - (b.u - a.u) * (c.v - a.v);
  if (!(area > 0 && a.inverse_z > 0 && b.inverse_z > 0 && c.inverse_z > 0)) return;
  const auto from = [](float x) {
    const int whole = static_cast<int>(std::clamp(x, 0.f, 1e6f));
    return whole + (static_cast<float>(whole) < x);
  };
  const auto to = [](float x, int size) {
    return static_cast<int>(std::clamp(x + 1, 0.f, static_cast<float>(size))) - 1;
  };
  const int left = from(std::min({a.u, b.u, c.u})), top = from(std::min({a.v, b.v, c.v}));
  const int right = to(std::max({a.u, b.u, c.u}), picture.width);
  const int bottom = to(std::max({a.v, b.v, c.v}), picture.height);
  if (left > right || top > bottom) return;
  // Shares of the corners b and c in a pixel, and what they grow by to the right and downwards.
  const float b_right = (a.v - c.v) / area, b_down = (c.u - a.u) / area;
  const float c_right = (b.v - a.v) / area, c_down = (a.u - b.u) / area;
  const float to_b = b.inverse_z - a.inverse_z, to_c = c.inverse_z - a.inverse_z;
  for (int y = top; y <= bottom; ++y) {
    const float down = static_cast<float>(y) - a.v;
    float* const row = picture.row(y);
    for (int x = left; x <= right; ++x) {
      const float across = static_cast<float>(x) - a.u;
      const float at_b = b_right * across + b_down * down, at_c = c_right * across + c_down * down;
      constexpr float kOnEdge = -1e-4f;
      if (at_b < kOnEdge || at_c < kOnEdge || 1 - at_b - at_c < kOnEdge) continue;
      row[x] = std::max(row[x], a.inverse_z + at_b * to_b + at_c * to_c);
    }
  }
}

View view_of(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera) {
  const int window_px = std::max(1, static_cast<int>(std::lround(kWindowRad * camera.fx)));
  View out{camera, T_world_camera.inverse(), window_px, ImageDepth(camera.width, camera.height)};
  const std::vector<DepthCorner> corners = corners_of(mesh, camera, out.T_camera_world);
  for (const auto& [i, j, k] : mesh.triangles)
    draw(corners[i], corners[j], corners[k], out.inverse_depth);
  return out;
}

void add_views(const Mesh& mesh, const SourceInfo& source, std::vector<View>& views) {
  if (source.depth_camera.model == CameraModel::pinhole) {
    const double factor = std::min(1.0, kPixelsPerRad / source.depth_camera.fx);
    views.push_back(view_of(mesh, scaled(source.depth_camera, factor), source.T_world_depth));
    return;
  }
  for (const kit::CubeFace& face : kit::cube_faces(kPixelsPerRadAround, 1))
    views.push_back(
        view_of(mesh, face.camera, source.T_world_depth * Pose{face.R_camera_face, {}}));
}

/// Where dot(per_depth, p) = 1, in the camera's frame.
struct Plane {
  Vec3d per_depth;
  double per_m = 0;  // length of per_depth

  Vec3d normal() const { return per_depth / -per_m; }  // towards the camera
  /// Before the plane is positive.
  double distance_m(Vec3d p) const { return (1 - dot(per_depth, p)) / per_m; }
};

/// The surface in a pixel and around it: 1 / depth is linear over a plane. None in the margin,
/// beside borders, depth jumps and sharp edges.
std::optional<Plane> plane_at(const View& view, double u, double v, double most_bend_m) {
  const int w = view.window_px;
  if (!(u > w && v > w && u < view.camera.width - 1 - w && v < view.camera.height - 1 - w))
    return {};
  const int x = static_cast<int>(u + 0.5), y = static_cast<int>(v + 0.5);
  const double at = *view.inverse_depth.at(x, y);
  const double l = *view.inverse_depth.at(x - w, y), r = *view.inverse_depth.at(x + w, y);
  const double t = *view.inverse_depth.at(x, y - w), b = *view.inverse_depth.at(x, y + w);
  if (!(at > 0 && l > 0 && r > 0 && t > 0 && b > 0)) return {};
  const double most_bend = most_bend_m * at * at;
  if (std::abs(l + r - 2 * at) > most_bend || std::abs(t + b - 2 * at) > most_bend) return {};
  Plane plane;
  plane.per_depth.x = (r - l) / (2 * w) * view.camera.fx;
  plane.per_depth.y = (b - t) / (2 * w) * view.camera.fy;
  plane.per_depth.z = at - plane.per_depth.x * ((x - view.camera.cx) / view.camera.fx) -
                      plane.per_depth.y * ((y - view.camera.cy) / view.camera.fy);
  plane.per_m = length(plane.per_depth);
  return plane;
}

std::optional<Plane> plane_at(const View& view, Vec3d p_camera, double most_bend_m) {
  if (p_camera.z < kit::kNearPlane_m) return {};
  const kit::ScreenPoint s = kit::to_screen(view.camera, p_camera);
  return plane_at(view, s.u, s.v, most_bend_m);
}

/// In [0, 1), the same for the same number.
double random_at(std::uint64_t number) {
  const std::uint64_t h = hash_cell({static_cast<std::int32_t>(number), 0, 0});
  return static_cast<double>(h >> 11) * 0x1p-53;
}

/// The sample with its normal over the window, if a sensor of the part sees it there.
std::optional<Sample> smoothed(const std::vector<View>& views, const Sample& raw, double voxel_m) {
  for (const View& view : views) {
    const Vec3d p = view.T_camera_world * raw.position;
    const auto plane = plane_at(view, p, 2 * voxel_m);
    if (!plane || std::abs(plane->distance_m(p)) > 2 * voxel_m) continue;
    const Vec3d normal = transposed(view.T_camera_world.rotation) * plane->normal();
    if (dot(normal, raw.normal) > 0) return Sample{raw.position, normal};
  }
  return {};
}

/// Spread by area: one in each of kSamples equal shares of it.
void add_samples(const Mesh& mesh, double voxel_m, Surface& out) {
  std::vector<double> up_to(mesh.triangles.size());
  double area = 0;
  for (std::size_t t = 0; t < up_to.size(); ++t)
    up_to[t] = area += 0.5 * static_cast<double>(length(mesh.area_normal(t)));
  if (!(area > 0)) return;
  out.sample_m2 = area / kSamples;
  std::size_t t = 0;
  for (std::size_t i = 0; i < kSamples; ++i) {
    const double place = (static_cast<double>(i) + random_at(3 * i)) * out.sample_m2;
    while (t + 1 < up_to.size() && up_to[t] <= place) ++t;
    double s = random_at(3 * i + 1), r = random_at(3 * i + 2);
    if (s + r > 1) s = 1 - s, r = 1 - r;
    const auto corner = [&](int c) { return vec_cast<double>(mesh.corner(t, c)); };
    const Sample raw{corner(0) + (corner(1) - corner(0)) * s + (corner(2) - corner(0)) * r,
                     normalized(vec_cast<double>(mesh.area_normal(t)))};
    if (const auto sample = smoothed(out.views, raw, voxel_m)) out.samples.push_back(*sample);
  }
}

Surface surface_of(const Part& part, double voxel_m) {
  Surface out;
  for (const SourceInfo& source : part.sources)
    out.eye += source.T_world_depth.translation / static_cast<double>(part.sources.size());
  if (part.mesh.empty()) return out;
  for (const Vec3f p : part.mesh.positions) out.box.add(p);
  for (const SourceInfo& source : part.sources) add_views(part.mesh, source, out.views);
  add_samples(part.mesh, voxel_m, out);
  return out;
}

std::vector<Surface> surfaces_of(std::span<const Part> parts, double voxel_m) {
  std::vector<Surface> out(parts.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) out[i] = surface_of(parts[i], voxel_m);
  });
  return out;
}

// ---- Two parts

struct Pair {
  std::uint32_t a, b;
  std::size_t stride_a, stride_b;  // of the samples that are looked at
};

std::vector<Pair> pairs_of(const std::vector<Surface>& surfaces, const RegistrationConfig& config) {
  std::vector<Pair> out;
  std::vector<std::size_t> neighbours(surfaces.size());
  for (std::uint32_t a = 0; a < surfaces.size(); ++a)
    for (std::uint32_t b = a + 1; b < surfaces.size(); ++b)
      if (meet(surfaces[a].box, surfaces[b].box, static_cast<float>(config.reach_m)))
        out.push_back({a, b, 1, 1}), ++neighbours[a], ++neighbours[b];
  const auto stride = [&](std::uint32_t part) {
    return std::clamp<std::size_t>(neighbours[part] / kPartsForAll, 1, kSamples / kLeastSamples);
  };
  for (Pair& p : out) p.stride_a = stride(p.a), p.stride_b = stride(p.b);
  return out;
}

/// A place that both parts show, in the world.
struct Match {
  Vec3d point, normal;
  double apart_m;  // how far a lies from b along the normal
  double area_m2;
};

/// What two parts show of each other.
struct PairLook {
  std::vector<Match> matches;
  double through_m2 = 0;  // of either, where the other sees through it
};

/// What a picture shows of a sample.
struct Sight {
  std::optional<Plane> plane;  // the same surface
  double distance_m = 0;       // before it
  bool through = false;
};

Sight sight_of(const View& view, Vec3d p, Vec3d normal, const RegistrationConfig& config) {
  const double bend_m = 2 * config.voxel_m;
  Sight out;
  if (dot(normal, p) > -kFacing * length(p)) return out;
  std::optional<Plane> plane = plane_at(view, p, bend_m);
  if (!plane) return out;
  out.distance_m = plane->distance_m(p);
  if (std::abs(out.distance_m) <= config.reach_m) {
    plane = plane_at(view, p - plane->normal() * out.distance_m, bend_m);  // nearer to its foot
    if (!plane || dot(plane->normal(), normal) < kAlike) return out;
    out.distance_m = plane->distance_m(p);
    if (std::abs(out.distance_m) <= config.reach_m) out.plane = plane;
  } else if (out.distance_m > 0) {
    out.through = 1 > dot(plane->per_depth, p + p * (config.reach_m / p.z));
  }
  return out;
}

/// Adds what `at` shows of `from`'s samples. `sign`: 1 when from is the pair's a.
void look(const Surface& from, const Pose& T_from, const Surface& at, const Pose& T_at,
          std::size_t stride, double sign, const RegistrationConfig& config, PairLook& out) {
  std::vector<Pose> T_camera_from;
  const Pose T_at_from = T_at.inverse() * T_from;
  for (const View& view : at.views) T_camera_from.push_back(view.T_camera_world * T_at_from);
  const double area_m2 = from.sample_m2 * static_cast<double>(stride);
  for (std::size_t i = 0; i < from.samples.size(); i += stride) {
    const Sample& sample = from.samples[i];
    Sight best;
    std::size_t seen_by = 0;
    bool through = false;
    for (std::size_t v = 0; v < at.views.size(); ++v) {
      const Pose& T = T_camera_from[v];
      const Sight sight =
          sight_of(at.views[v], T * sample.position, T.rotation * sample.normal, config);
      through |= sight.through;
      const bool nearer = !best.plane || std::abs(sight.distance_m) < std::abs(best.distance_m);
      if (sight.plane && nearer) best = sight, seen_by = v;
    }
    if (best.plane) {
      const Mat3 R_world_camera =
          T_at.rotation * transposed(at.views[seen_by].T_camera_world.rotation);
      out.matches.push_back({T_from * sample.position, R_world_camera * best.plane->normal(),
                             sign * best.distance_m, area_m2});
    } else if (through) {
      out.through_m2 += area_m2;
    }
  }
}

/// Directed both ways; `apart_m` is along normals that point out of either surface, so for b's
/// samples its sign is turned.
PairLook look(const std::vector<Surface>& surfaces, std::span<const Pose> poses, const Pair& pair,
              const RegistrationConfig& config) {
  const auto [a, b, stride_a, stride_b] = pair;
  PairLook out;
  look(surfaces[a], poses[a], surfaces[b], poses[b], stride_a, 1, config, out);
  look(surfaces[b], poses[b], surfaces[a], poses[a], stride_b, -1, config, out);
  return out;
}

/// Matches farther apart than this are of different surfaces, judged by the others.
double trim_m(const PairLook& look, const RegistrationConfig& config) {
  if (look.matches.empty()) return 0;
  std::vector<double> apart;
  for (const Match& m : look.matches) apart.push_back(std::abs(m.apart_m));
  const auto middle = apart.begin() + static_cast<std::ptrdiff_t>(apart.size() / 2);
  std::nth_element(apart.begin(), middle, apart.end());
  return std::clamp(4.5 * *middle, 1.5 * config.voxel_m, config.reach_m);
}

PairResidual residual_of(const Pair& pair, const PairLook& look, double trim_m) {
  PairResidual out{pair.a, pair.b, 0, 0, look.through_m2 / 2, 0};
  double squares = 0, area = 0, all_squares = 0, all_area = 0;
  for (const Match& m : look.matches) {
    all_squares += m.area_m2 * m.apart_m * m.apart_m, all_area += m.area_m2;
    if (std::abs(m.apart_m) > trim_m) continue;
    squares += m.area_m2 * m.apart_m * m.apart_m, area += m.area_m2;
  }
  out.shared_m2 = area / 2, out.expected_m2 += area / 2;
  if (area > 0) out.residual_mm = std::sqrt(squares / area) * 1000;
  if (all_area > 0) out.untrimmed_mm = std::sqrt(all_squares / all_area) * 1000;
  return out;
}

struct Overlap {
  Pair pair;
  PairLook look;
  double trim_m = 0;
  PairResidual residual;
};

std::vector<Overlap> overlaps_of(const std::vector<Surface>& surfaces, std::span<const Pose> poses,
                                 const RegistrationConfig& config) {
  std::vector<Overlap> out;
  for (const Pair& pair : pairs_of(surfaces, config)) out.push_back({pair, {}, 0, {}});
  parallel_for(out.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Overlap& o = out[i];
      o.look = look(surfaces, poses, o.pair, config);
      o.trim_m = trim_m(o.look, config);
      o.residual = residual_of(o.pair, o.look, o.trim_m);
    }
  });
  return out;
}

std::vector<PairResidual> worth_telling(const std::vector<Overlap>& overlaps) {
  std::vector<PairResidual> out;
  for (const Overlap& o : overlaps)
    if (o.residual.expected_m2 >= kLeastShared_m2) out.push_back(o.residual);
  return out;
}

bool agree(const PairResidual& r, double limit_mm) {
  return r.residual_mm <= limit_mm && r.shared_m2 >= kLeastSharedArea * r.expected_m2;
}

// ---- Groups of parts

/// Marks the members of the largest group within each set of parts that overlap; none where two
/// are as large.
std::vector<std::uint8_t> in_largest(DisjointSets& overlap, DisjointSets& groups,
                                     std::size_t parts) {
  std::vector<std::uint32_t> size(parts), largest(parts);
  for (std::uint32_t i = 0; i < parts; ++i) ++size[groups.of(i)];
  std::vector<std::uint32_t> winner(parts, static_cast<std::uint32_t>(parts));
  for (std::uint32_t i = 0; i < parts; ++i) {
    if (groups.of(i) != i) continue;
    const std::uint32_t set = overlap.of(i);
    if (size[i] > largest[set])
      largest[set] = size[i], winner[set] = i;
    else if (size[i] == largest[set])
      winner[set] = static_cast<std::uint32_t>(parts);
  }
  std::vector<std::uint8_t> out(parts);
  for (std::uint32_t i = 0; i < parts; ++i) out[i] = winner[overlap.of(i)] == groups.of(i);
  return out;
}

/// Of the area that each part should share with members, the share where it does not fit them.
std::vector<double> misfits(std::span<const PairResidual> residuals,
                            const std::vector<std::uint8_t>& member, double limit_mm) {
  std::vector<double> all(member.size()), odd(member.size());
  for (const PairResidual& r : residuals)
    for (const auto& [part, other] : {std::pair{r.a, r.b}, std::pair{r.b, r.a}})
      if (member[other]) {
        all[part] += r.expected_m2;
        if (!agree(r, limit_mm)) odd[part] += r.expected_m2;
      }
  for (std::size_t i = 0; i < all.size(); ++i) odd[i] = all[i] > 0 ? odd[i] / all[i] : 0;
  return odd;
}

// ---- Small linear algebra

using Vec6 = std::array<double, 6>;
using Mat6 = std::array<Vec6, 6>;

Vec6 operator*(const Mat6& a, const Vec6& v) {
  Vec6 out{};
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) out[i] += a[i][j] * v[j];
  return out;
}

Mat6 operator*(const Mat6& a, const Mat6& b) {
  Mat6 out{};
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k < 6; ++k)
      for (int j = 0; j < 6; ++j) out[i][j] += a[i][k] * b[k][j];
  return out;
}

/// Of a positive definite matrix.
Mat6 inverse(Mat6 a) {
  for (int k = 0; k < 6; ++k) {
    const double pivot = 1 / a[k][k];
    a[k][k] = 1;
    for (double& x : a[k]) x *= pivot;
    for (int i = 0; i < 6; ++i) {
      if (i == k) continue;
      const double factor = std::exchange(a[i][k], 0);
      for (int j = 0; j < 6; ++j) a[i][j] -= factor * a[k][j];
    }
  }
  return a;
}

/// Directions along which `a` holds less than `least` are taken out: each eigenvalue x is weighed
/// with x⁴ / (x⁴ + least⁴). Returns the projection.
Mat6 held_directions(const Mat6& a, double least) {
  const Mat6 square = a * a, fourth = square * square;
  Mat6 sum = fourth;
  for (int i = 0; i < 6; ++i) sum[i][i] += least * least * least * least;
  return fourth * inverse(sum);
}

// ---- All parts at once

constexpr double kArm_m = 2;             // a turn by 1 rad counts as so much of a shift
constexpr double kHeldDirection = 0.01;  // a direction is open where less of the overlap holds it
constexpr double kStay = 3e-4;           // pull towards no correction, against that of the overlaps
constexpr double kPoorResidual = 0.02;   // m; pairs that fit worse count less

/// What two parts' overlap says about where they should be: the sum over its matches of squared
/// distances after a small motion of a against b, per area.
struct Link {
  std::uint32_t a = 0, b = 0;
  Vec3d arm_a, arm_b;  // from their eyes to the middle of the overlap
  double radius_m = 1;
  double weight = 0;
  Mat6 hold{};  // by turn · radius and shift in the middle
  Vec6 pull{};
};

Link link_of(const Overlap& overlap, const std::vector<Surface>& surfaces) {
  const auto& [pair, look, trim_m, residual] = overlap;
  Link out;
  out.a = pair.a, out.b = pair.b;
  double area = 0, spread = 0;
  Vec3d sum;
  for (const Match& m : look.matches)
    if (std::abs(m.apart_m) <= trim_m) area += m.area_m2, sum += m.point * m.area_m2;
  const Vec3d middle = sum / area;
  for (const Match& m : look.matches)
    if (std::abs(m.apart_m) <= trim_m)
      spread += m.area_m2 * dot(m.point - middle, m.point - middle);
  out.radius_m = std::max(std::sqrt(spread / area), 0.05);
  for (const Match& m : look.matches) {
    if (std::abs(m.apart_m) > trim_m) continue;
    const Vec3d turn = cross(m.point - middle, m.normal) / out.radius_m;
    const Vec6 row{turn.x, turn.y, turn.z, m.normal.x, m.normal.y, m.normal.z};
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) out.hold[i][j] += m.area_m2 / area * row[i] * row[j];
      out.pull[i] += m.area_m2 / area * row[i] * m.apart_m;
    }
  }
  const Mat6 held = held_directions(out.hold, kHeldDirection);
  out.hold = held * out.hold, out.pull = held * out.pull;
  const double poor = residual.residual_mm / 1000 / kPoorResidual;
  out.weight = residual.shared_m2 / (1 + poor * poor);
  out.arm_a = middle - surfaces[pair.a].eye, out.arm_b = middle - surfaces[pair.b].eye;
  return out;
}

/// A small motion of a sensor.
struct Motion {
  Vec3d turn, shift;  // both in metres: turn · kArm_m

  friend Motion operator+(const Motion& a, const Motion& b) {
    return {a.turn + b.turn, a.shift + b.shift};
  }
  friend Motion operator*(const Motion& a, double s) { return {a.turn * s, a.shift * s}; }
};
using Motions = std::vector<Motion>;

double dot(const Motions& a, const Motions& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += mr::dot(a[i].turn, b[i].turn) + mr::dot(a[i].shift, b[i].shift);
  return sum;
}

/// Of a against b in the middle of their overlap.
Vec6 relative(const Link& link, const Motions& motions) {
  const Motion &a = motions[link.a], &b = motions[link.b];
  const Vec3d turn = (a.turn - b.turn) * (link.radius_m / kArm_m);
  const Vec3d shift =
      a.shift + cross(a.turn, link.arm_a) / kArm_m - b.shift - cross(b.turn, link.arm_b) / kArm_m;
  return {turn.x, turn.y, turn.z, shift.x, shift.y, shift.z};
}

/// The transpose of relative(): adds what a force on the overlap does to the two sensors.
void add_force(const Link& link, const Vec6& force, double factor, Motions& out) {
  const Vec3d turn = Vec3d{force[0], force[1], force[2]} * (factor * link.radius_m / kArm_m);
  const Vec3d push = Vec3d{force[3], force[4], force[5]} * factor;
  out[link.a].shift += push, out[link.b].shift += -push;
  out[link.a].turn += turn + cross(link.arm_a, push) / kArm_m;
  out[link.b].turn += -turn - cross(link.arm_b, push) / kArm_m;
}

/// The motions that bring the linked parts together (one step of Gauss and Newton), by conjugate
/// gradients. As nothing but the pull towards no correction sees a common motion of all, their
/// mean stays where it is.
Motions solve(const std::vector<Link>& links, const Motions& corrections) {
  const std::size_t parts = corrections.size();
  double stay = 0;
  Motions rest(parts), motions(parts);
  std::vector<std::uint8_t> linked(parts);
  for (const Link& link : links) {
    add_force(link, link.pull, -link.weight, rest);
    stay += 2 * kStay * link.weight;
    linked[link.a] = linked[link.b] = 1;
  }
  const auto count = std::count(linked.begin(), linked.end(), 1);
  if (count == 0) return motions;
  stay /= static_cast<double>(count);
  for (std::size_t i = 0; i < parts; ++i)
    if (linked[i]) rest[i] = rest[i] + corrections[i] * -stay;

  Motions along = rest, across(parts);
  double left = dot(rest, rest);
  const double enough = 1e-12 * left;
  for (std::size_t step = 0; step < std::min<std::size_t>(6 * parts, 300) && left > enough;
       ++step) {
    for (std::size_t i = 0; i < parts; ++i) across[i] = along[i] * stay;
    for (const Link& link : links)
      add_force(link, link.hold * relative(link, along), link.weight, across);
    const double length = left / dot(along, across), before = left;
    for (std::size_t i = 0; i < parts; ++i)
      motions[i] = motions[i] + along[i] * length, rest[i] = rest[i] + across[i] * -length;
    left = dot(rest, rest);
    for (std::size_t i = 0; i < parts; ++i) along[i] = rest[i] + along[i] * (left / before);
  }
  return motions;
}

// ---- Following

constexpr double kStep_m = 0.001, kStep_rad = 0.05 * kDegree;  // per update
constexpr double kAtRest = 0.1;                                // of a step
constexpr double kMost_m = 0.05, kMost_rad = 2 * kDegree;      // altogether
constexpr double kFollow = 0.5;                                // of the way, per update
constexpr double kOdd_mm = 60;
constexpr double kWild = 2;        // times the limits
constexpr double kBetter = 0.999;  // costs after to costs before

double shift_m(const Motion& m) { return length(m.shift); }
double turn_rad(const Motion& m) { return length(m.turn) / kArm_m; }

/// About the eye (Rodrigues' formula).
Pose pose_of(const Motion& motion, Vec3d eye) {
  const double angle = turn_rad(motion);
  const Vec3d axis = normalized(motion.turn);
  const double c = std::cos(angle), s = std::sin(angle);
  Pose out;
  for (int column = 0; column < 3; ++column) {
    Vec3d unit;
    unit[column] = 1;
    const Vec3d turned = unit * c + cross(axis, unit) * s + axis * (dot(axis, unit) * (1 - c));
    for (int row = 0; row < 3; ++row) out.rotation(row, column) = turned[row];
  }
  out.translation = eye + motion.shift - out.rotation * eye;
  return out;
}

std::vector<Pose> poses_of(const Motions& corrections, const std::vector<Surface>& surfaces) {
  std::vector<Pose> out;
  for (std::size_t i = 0; i < corrections.size(); ++i)
    out.push_back(pose_of(corrections[i], surfaces[i].eye));
  return out;
}

/// What does not fit, with a limit for each match: the same for two looks of one pair.
double cost(const PairLook& look, double trim_m) {
  double sum = look.through_m2 * trim_m * trim_m, area = look.through_m2;
  for (const Match& m : look.matches) {
    const double apart = std::min(std::abs(m.apart_m), trim_m);
    sum += m.area_m2 * apart * apart, area += m.area_m2;
  }
  return area > 0 ? sum / area : trim_m * trim_m;
}

/// The overlaps that parts are aligned by.
std::vector<Overlap> sound(std::vector<Overlap> overlaps, std::span<const std::uint32_t> odd) {
  const auto is_odd = [&](std::uint32_t part) { return std::ranges::find(odd, part) != odd.end(); };
  std::erase_if(overlaps, [&](const Overlap& o) {
    return o.residual.shared_m2 < kLeastShared_m2 || o.look.matches.size() < kLeastMatches ||
           !agree(o.residual, kOdd_mm) || is_odd(o.pair.a) || is_odd(o.pair.b);
  });
  return overlaps;
}

/// What is aligned, and how.
struct Plan {
  std::vector<Overlap> overlaps;
  Motions motions;            // the full way
  std::vector<double> after;  // cost() of the overlaps there, m²
};

bool beyond_limits(const Motion& m, double factor) {
  return shift_m(m) > factor * kMost_m || turn_rad(m) > factor * kMost_rad;
}

/// Parts that would have to go far beyond the limits are left out.
Plan plan_of(std::vector<Overlap> overlaps, const std::vector<Surface>& surfaces,
             const Motions& corrections) {
  for (;;) {
    std::vector<Link> links;
    for (const Overlap& o : overlaps) links.push_back(link_of(o, surfaces));
    Motions motions = solve(links, corrections);
    const auto too_far = [&](std::uint32_t i) {
      return beyond_limits(corrections[i] + motions[i], kWild);
    };
    const auto left_out = std::erase_if(
        overlaps, [&](const Overlap& o) { return too_far(o.pair.a) || too_far(o.pair.b); });
    if (left_out == 0) return {std::move(overlaps), std::move(motions), {}};
  }
}

void look_ahead(Plan& plan, const std::vector<Surface>& surfaces, const Motions& corrections,
                const RegistrationConfig& config) {
  Motions moved = corrections;
  for (std::size_t i = 0; i < moved.size(); ++i) moved[i] = moved[i] + plan.motions[i];
  const std::vector<Pose> poses = poses_of(moved, surfaces);
  plan.after.resize(plan.overlaps.size());
  parallel_for(plan.after.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Overlap& o = plan.overlaps[i];
      plan.after[i] = cost(look(surfaces, poses, o.pair, config), o.trim_m);
    }
  });
}

/// A plan without overlaps that no small motion explains: those that stay far apart and get little
/// nearer. They would pull the others off.
Plan checked_plan(std::vector<Overlap> overlaps, const std::vector<Surface>& surfaces,
                  const Motions& corrections, const RegistrationConfig& config) {
  Plan plan = plan_of(std::move(overlaps), surfaces, corrections);
  look_ahead(plan, surfaces, corrections, config);
  std::vector<Overlap> explained;
  for (std::size_t i = 0; i < plan.after.size(); ++i) {
    const Overlap& o = plan.overlaps[i];
    const double rms_m = std::sqrt(plan.after[i]);
    if (rms_m <= kPoorResidual || rms_m <= 0.5 * o.residual.residual_mm / 1000)
      explained.push_back(o);
  }
  if (explained.size() == plan.overlaps.size()) return plan;
  plan = plan_of(std::move(explained), surfaces, corrections);
  look_ahead(plan, surfaces, corrections, config);
  return plan;
}

/// How much of its way each part goes: the same for parts that are linked, so that they keep
/// together. None where the full way would not bring them closer, or once one is at its limit.
std::vector<double> shares(const Plan& plan, const Motions& corrections) {
  const std::size_t parts = corrections.size();
  DisjointSets sets(parts);
  for (const Overlap& o : plan.overlaps) sets.join(o.pair.a, o.pair.b);
  std::vector<double> gain(parts), of_set(parts, kFollow), out(parts);
  for (std::size_t i = 0; i < plan.overlaps.size(); ++i) {
    const Overlap& o = plan.overlaps[i];
    gain[sets.of(o.pair.a)] +=
        o.residual.shared_m2 * (kBetter * cost(o.look, o.trim_m) - plan.after[i]);
  }
  for (std::uint32_t i = 0; i < parts; ++i) {
    const Motion& m = plan.motions[i];
    const double steps = std::max(shift_m(m) / kStep_m, turn_rad(m) / kStep_rad);
    double& share = of_set[sets.of(i)];
    if (steps * share > 1) share = 1 / steps;
    if (!(gain[sets.of(i)] > 0)) share = 0;
  }
  for (std::uint32_t i = 0; i < parts; ++i)
    if (double& share = of_set[sets.of(i)];
        beyond_limits(corrections[i] + plan.motions[i] * share, 1))
      share = 0;
  for (std::uint32_t i = 0; i < parts; ++i) out[i] = of_set[sets.of(i)];
  return out;
}

}  // namespace

std::vector<PairResidual> pair_residuals(std::span<const Part> parts,
                                         const RegistrationConfig& config) {
  const std::vector<Pose> as_they_are(parts.size());
  return worth_telling(overlaps_of(surfaces_of(parts, config.voxel_m), as_they_are, config));
}

std::vector<std::uint32_t> outliers(std::span<const PairResidual> residuals, std::size_t parts,
                                    double limit_mm) {
  DisjointSets overlap(parts), groups(parts);
  for (const PairResidual& r : residuals) {
    MR_ASSERT(r.a < parts && r.b < parts);
    overlap.join(r.a, r.b);
    if (agree(r, limit_mm)) groups.join(r.a, r.b);
  }
  std::vector<std::uint8_t> member = in_largest(overlap, groups, parts);
  std::vector<double> misfit = misfits(residuals, member, limit_mm);
  const auto within = [&](std::size_t i) { return member[i] ? misfit[i] : 0; };
  for (std::size_t round = 0; round < parts; ++round) {  // in the group by chance: out, worst first
    std::size_t worst = 0;
    for (std::size_t i = 1; i < parts; ++i)
      if (within(i) > within(worst)) worst = i;
    if (within(worst) <= 0.5) break;
    member[worst] = 0;
    misfit = misfits(residuals, member, limit_mm);
  }
  std::vector<std::uint32_t> out;
  for (std::uint32_t i = 0; i < parts; ++i)
    if (!member[i] && misfit[i] > 0.5) out.push_back(i);
  return out;
}

std::vector<Pose> Refiner::update(std::span<const Part> parts, std::span<const std::uint64_t> ids) {
  MR_ASSERT(parts.size() == ids.size());
  const std::vector<Surface> surfaces = surfaces_of(parts, config_.voxel_m);
  Motions corrections(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto known = std::ranges::find(corrections_, ids[i], &Correction::id);
    if (known != corrections_.end()) corrections[i] = {known->turn * kArm_m, known->shift};
  }

  std::vector<Overlap> overlaps = overlaps_of(surfaces, poses_of(corrections, surfaces), config_);
  residuals_ = worth_telling(overlaps);
  const auto odd = outliers(residuals_, parts.size(), kOdd_mm);
  const Plan plan = checked_plan(sound(std::move(overlaps), odd), surfaces, corrections, config_);
  const std::vector<double> share = shares(plan, corrections);

  corrections_.clear();
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Motion step = plan.motions[i] * share[i];
    if (shift_m(step) >= kAtRest * kStep_m || turn_rad(step) >= kAtRest * kStep_rad)
      corrections[i] = corrections[i] + step;
    corrections_.push_back({ids[i], corrections[i].turn / kArm_m, corrections[i].shift});
  }
  return poses_of(corrections, surfaces);
}

}  // namespace mr::merge
