#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "mr/kit/part.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"
#include "mr/merge/merge_surfaces.h"
#include "support/meshes.h"
#include "support/rays.h"

/// Surfaces seen by several sensors, merged as a merger does it, and what to ask of the result.
namespace mr::test {

inline constexpr double kVoxel_m = 0.01;

/// A surface in triangles with edges of about this length.
using Shape = std::function<Mesh(float cell_m)>;

struct SensorPlacement {
  Vec3d at, target;
};

struct CaptureOptions {
  float cell_m = 0.03f;
  float noise_m = 0;   ///< vertices lie up to this far off, along the normal
  float offset_m = 0;  ///< every second sensor measures this much too far
  int holes = 0;       ///< discs of 6 to 10 cm that are missing, at other places for each sensor
};

inline int cells(float length_m, float cell_m) {
  return std::max(1, static_cast<int>(std::round(length_m / cell_m)));
}

/// Uniform in [0, 1).
inline float unit(std::mt19937& random) { return static_cast<float>(random()) / 4294967296.0f; }

inline Mesh with_noise(Mesh mesh, float noise_m, unsigned seed) {
  std::mt19937 random(seed);
  const std::vector<Vec3f> normals = kit::vertex_normals(mesh);
  for (std::size_t v = 0; v < normals.size(); ++v)
    mesh.positions[v] = mesh.positions[v] + normals[v] * (noise_m * (2 * unit(random) - 1));
  return mesh;
}

inline Mesh with_holes(const Mesh& mesh, int holes, unsigned seed) {
  if (mesh.empty()) return mesh;
  std::mt19937 random(seed);
  std::vector<std::uint8_t> keep(mesh.triangles.size(), 1);
  for (int i = 0; i < holes; ++i) {
    const Vec3f middle = mesh.centroid(random() % mesh.triangles.size());
    const float radius = 0.03f + 0.02f * unit(random);
    for (std::size_t t = 0; t < keep.size(); ++t)
      keep[t] &= length(mesh.centroid(t) - middle) > radius;
  }
  return select_triangles(mesh, keep);
}

/// The part of `mesh` visible to a camera: triangles that face it, with all corners inside the
/// picture and not occluded by `truth`.
inline Mesh visible(const Mesh& mesh, const Mesh& truth, const Camera& camera, const Pose& T) {
  const Mesh* meshes[] = {&truth};
  const kit::RayScene rays(meshes);
  const Pose T_camera_world = T.inverse();
  const Vec3f eye = vec_cast<float>(T.translation);
  std::vector<std::uint8_t> seen, keep;
  for (const Vec3f p : mesh.positions) {
    const auto pixel = project(camera, T_camera_world * vec_cast<double>(p));
    const bool inside = pixel && pixel->x >= 0 && pixel->y >= 0 && pixel->x <= camera.width - 1 &&
                        pixel->y <= camera.height - 1;
    const float near_enough = 1 - 0.01f / length(p - eye);
    seen.push_back(inside && !rays.first_hit(eye, p - eye, 0, near_enough));
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f ray = normalized(mesh.centroid(t) - eye), n = normalized(mesh.area_normal(t));
    const auto& [a, b, c] = mesh.triangles[t];
    keep.push_back(seen[a] && seen[b] && seen[c] && dot(ray, n) < -0.15f);
  }
  return select_triangles(mesh, keep);
}

/// One part per sensor, each with its own triangulation.
inline std::vector<kit::Part> seen_by(const Shape& shape, std::span<const SensorPlacement> sensors,
                                      const CaptureOptions& options) {
  const Mesh truth = shape(0.02f);
  std::vector<kit::Part> parts;
  for (std::uint32_t i = 0; i < sensors.size(); ++i) {
    const Pose T = look_at(sensors[i].at, sensors[i].target, {0, -1, 0});
    const SourceInfo from = source(i, T);
    const float cell_m = options.cell_m * (1 + 0.07f * static_cast<float>(i));
    Mesh mesh = visible(shape(cell_m), truth, from.depth_camera, T);
    mesh = with_noise(with_holes(mesh, options.holes, 17 + i), options.noise_m, 5 + i);
    const float error_m = i % 2 == 0 ? 0 : options.offset_m;
    for (Vec3f& p : mesh.positions) p = p + vec_cast<float>(T.rotation.column(2)) * error_m;
    parts.push_back({std::move(mesh), 0.001f, {from}});
  }
  return parts;
}

/// z = 2, from -1 to 1, facing -z; y is down.
inline Mesh wall_shape(float cell_m) {
  const int n = cells(2, cell_m);
  return grid({-1, 1, 2}, {2, 0, 0}, {0, -2, 0}, n, n);
}

/// Two walls and the floor of a room, 1.2 m each.
inline Mesh corner_shape(float cell_m) {
  const int n = cells(1.2f, cell_m);
  const float s = 1.2f;
  Mesh mesh = grid({0, s, s}, {s, 0, 0}, {0, -s, 0}, n, n);     // z = s, faces -z
  append(mesh, grid({s, s, s}, {0, 0, -s}, {0, -s, 0}, n, n));  // x = s, faces -x
  append(mesh, grid({0, s, 0}, {s, 0, 0}, {0, 0, s}, n, n));    // y = s, faces -y: up
  return kit::weld(mesh);
}

inline Mesh sphere_shape(float cell_m) {
  const float radius = 0.5f;
  return sphere({0, 0, 0}, radius, cells(std::numbers::pi_v<float> * radius, cell_m));
}

/// An upright tube as wide and as high as a person.
inline Mesh cylinder_shape(float cell_m) {
  constexpr float kRadius = 0.25f, kHeight = 1.5f, kTurn = 2 * std::numbers::pi_v<float>;
  const int around = cells(kTurn * kRadius, cell_m), up = cells(kHeight, cell_m);
  Mesh mesh = grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, around, up);
  for (int j = 0; j <= up; ++j)
    for (int i = 0; i <= around; ++i) {
      const float turn = kTurn * static_cast<float>(i % around) / static_cast<float>(around);
      Vec3f& p = mesh.positions[j * (around + 1) + i];
      p = {kRadius * std::cos(turn), kHeight * (p.y - 0.5f), -kRadius * std::sin(turn)};
    }
  return kit::weld(mesh);
}

/// A table that bears a board of 4 cm; seen from above, which is -y.
inline Mesh step_shape(float cell_m) {
  const int nx = cells(1.4f, cell_m), nz = cells(1, cell_m);
  Mesh mesh = grid({-0.7f, 0, -0.5f}, {1.4f, 0, 0}, {0, 0, 1}, nx, nz);
  for (Vec3f& p : mesh.positions)
    if (std::abs(p.x) < 0.3f && std::abs(p.z) < 0.2f) p.y = -0.04f;
  return mesh;
}

/// A wall at z = 2.1, and before its left half another at z = 2.
inline Mesh sheets_shape(float cell_m) {
  const int n = cells(2, cell_m);
  Mesh mesh = grid({-1, 1, 2.1f}, {2, 0, 0}, {0, -2, 0}, n, n);
  append(mesh, grid({-1, 1, 2}, {1, 0, 0}, {0, -2, 0}, std::max(n / 2, 1), n));
  return mesh;
}

/// A table top of 1 m and the floor beneath.
inline Mesh table_shape(float cell_m) {
  const int n = cells(1, cell_m);
  Mesh mesh = grid({-1, 0.7f, -1}, {2, 0, 0}, {0, 0, 2}, 2 * n, 2 * n);
  append(mesh, grid({-0.5f, 0, -0.5f}, {1, 0, 0}, {0, 0, 1}, n, n));
  return mesh;
}

inline std::vector<SensorPlacement> sensors_before_the_wall(int count) {
  if (count == 2) return {{{-0.6, 0, 0.2}, {-0.45, 0, 2}}, {{0.6, 0, 0.2}, {0.45, 0, 2}}};
  std::vector<SensorPlacement> sensors{{{-0.6, -0.3, 0.2}, {-0.45, -0.3, 2}},
                                       {{0.6, -0.3, 0.2}, {0.45, -0.3, 2}},
                                       {{-0.3, 0.5, 0.1}, {-0.3, 0.4, 2}},
                                       {{0.5, 0.5, 0.3}, {0.4, 0.4, 2}}};
  sensors.resize(static_cast<std::size_t>(count));
  return sensors;
}

inline std::vector<SensorPlacement> sensors_around(double radius_m, double height_m, int count) {
  std::vector<SensorPlacement> sensors;
  for (int i = 0; i < count; ++i) {
    const double turn = 2 * std::numbers::pi * (i + 0.1) / count;
    sensors.push_back(
        {{radius_m * std::cos(turn), -height_m, radius_m * std::sin(turn)}, {0, 0, 0}});
  }
  return sensors;
}

/// All six sides of a ball; look_at() bears no view straight down.
inline std::vector<SensorPlacement> sensors_on_six_sides() {
  return {{{1.5, 0, 0}, {}},  {{-1.5, 0, 0}, {}},   {{0, 0, 1.5}, {}},
          {{0, 0, -1.5}, {}}, {{0.01, 1.5, 0}, {}}, {{0, -1.5, 0.01}, {}}};
}

inline std::vector<SensorPlacement> sensors_in_the_corner() {
  return {{{-0.6, 0.2, 0.3}, {0.8, 0.8, 0.8}},
          {{0.4, 0.1, -0.7}, {0.8, 0.7, 0.9}},
          {{-0.2, -0.6, -0.2}, {0.7, 0.9, 0.7}}};
}

/// Overlap removal, zipper and islands with the settings of a node.
struct Merged {
  std::vector<Mesh> owned;  ///< per part
  Mesh mesh;
};
inline Merged merged(std::span<const kit::Part> parts,
                     merge::MergeConfig::Owner owner = merge::MergeConfig::Owner::coherent,
                     double voxel_m = kVoxel_m) {
  Merged out;
  merge::MergeHooks hooks;
  hooks.after_overlap = [&](std::span<const Mesh> owned, merge::ZipperConfig&) {
    out.owned.assign(owned.begin(), owned.end());
  };
  out.mesh = merge::merge_surfaces(
      parts, merge::surfaces_config({.owner = owner, .voxel_m = voxel_m}), nullptr, hooks);
  return out;
}

/// Points of a surface, evenly by area.
struct SurfacePoint {
  Vec3f point, normal;
  std::uint32_t triangle = 0;
};
inline std::vector<SurfacePoint> points_on(const Mesh& mesh, double per_m2, unsigned seed = 3) {
  std::mt19937 random(seed);
  std::vector<SurfacePoint> out;
  double due = unit(random);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f n = mesh.area_normal(t);
    for (due += per_m2 * 0.5 * length(n); due >= 1; due -= 1) {
      float a = unit(random), b = unit(random);
      if (a + b > 1) a = 1 - a, b = 1 - b;
      const Vec3f p = mesh.corner(t, 0);
      out.push_back(
          {p + (mesh.corner(t, 1) - p) * a + (mesh.corner(t, 2) - p) * b, normalized(n), t});
    }
  }
  return out;
}

/// Rays at meshes, which must outlive it.
class Rays {
 public:
  explicit Rays(std::vector<const Mesh*> meshes) : meshes_(std::move(meshes)), scene_(meshes_) {}

  const kit::RayScene& scene() const { return scene_; }
  Vec3f normal(std::uint32_t mesh, std::uint32_t triangle) const {
    return normalized(meshes_[mesh]->area_normal(triangle));
  }
  /// Surfaces that face alike above and below a point, within `range`: distances along the normal.
  std::vector<float> layers(const SurfacePoint& from, float range) const {
    std::vector<kit::RayHit> hits;
    scene_.all_hits(from.point + from.normal * range, -from.normal, 0, 2 * range, hits);
    std::vector<float> out;
    for (const kit::RayHit& h : hits)
      if (dot(normal(h.mesh, h.triangle), from.normal) > 0.5f) out.push_back(range - h.distance);
    return out;
  }

 private:
  std::vector<const Mesh*> meshes_;
  kit::RayScene scene_;
};

inline std::vector<const Mesh*> meshes_of(std::span<const kit::Part> parts) {
  std::vector<const Mesh*> out;
  for (const kit::Part& part : parts) out.push_back(&part.mesh);
  return out;
}

/// Share of a surface's area that has a second layer, facing alike, within `range_m`.
inline double doubled_area_share(const Mesh& mesh, float range_m, double per_m2 = 1500) {
  const Rays rays({&mesh});
  const std::vector<SurfacePoint> points = points_on(mesh, per_m2);
  int doubled = 0;
  for (const SurfacePoint& p : points) doubled += rays.layers(p, range_m).size() > 1;
  return points.empty() ? 0 : doubled / static_cast<double>(points.size());
}

/// What a merge left open of what its parts show.
struct Openings {
  double missing = 0;  ///< share of the parts' area that lies farther than the limit from the mesh
  double gaps = 0;     ///< share of points well inside their union that lie in a gap wider than
                       ///< one voxel
};

/// Whether the parts' union reaches 4 cm beyond a point on all sides.
inline bool is_inside(const Rays& parts, const SurfacePoint& p) {
  const Vec3f side = normalized(std::abs(p.normal.x) < 0.7f ? cross(p.normal, Vec3f{1, 0, 0})
                                                            : cross(p.normal, Vec3f{0, 1, 0}));
  const Vec3f other = cross(p.normal, side);
  for (int i = 0; i < 8; ++i) {
    const float turn = 0.7853982f * static_cast<float>(i);
    const Vec3f q = p.point + (side * std::cos(turn) + other * std::sin(turn)) * 0.04f;
    if (parts.layers({q, p.normal, 0}, 0.03f).empty()) return false;
  }
  return true;
}

inline Openings openings(std::span<const kit::Part> parts, const Mesh& mesh, double limit_m,
                         double per_m2 = 400) {
  const Rays all(meshes_of(parts)), rays({&mesh});
  double points = 0, missing = 0, inside = 0, open = 0;
  for (std::size_t i = 0; i < parts.size(); ++i)
    for (const SurfacePoint& p : points_on(parts[i].mesh, per_m2, 11 + static_cast<unsigned>(i))) {
      const auto near = rays.scene().nearest(p.point);
      ++points, missing += !near || near->distance_m > limit_m;
      const auto crossing = [&] {
        std::vector<kit::RayHit> hits;
        rays.scene().all_hits(p.point + p.normal * 0.03f, -p.normal, 0, 0.06f, hits);
        return !hits.empty();
      };
      if (!is_inside(all, p)) continue;
      ++inside;
      if (!near) ++open;
      if (!near || crossing()) continue;
      const Vec3f d = vec_cast<float>(near->point) - p.point;
      open += length(d - p.normal * dot(d, p.normal)) > kVoxel_m / 2;
    }
  return {points > 0 ? missing / points : 0, inside > 0 ? open / inside : 0};
}

/// Triangles that face away from all surfaces of the parts beside them, or have none beside them.
/// Beside: within a voxel of what is nearest, so that both sides of a crease count.
inline std::size_t count_turned(std::span<const kit::Part> parts, const Mesh& mesh,
                                double reach_m) {
  std::vector<Rays> of_part;
  for (const kit::Part& part : parts) of_part.emplace_back(std::vector{&part.mesh});
  std::vector<Vec3f> probes{{}};
  for (int axis = 0; axis < 3; ++axis)
    for (const float side : {-1.0f, 1.0f}) {
      probes.emplace_back();
      probes.back()[axis] = side * static_cast<float>(kVoxel_m);
    }
  std::size_t turned = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f n = normalized(mesh.area_normal(t));
    const auto agrees = [&](const Rays& rays) {
      return std::any_of(probes.begin(), probes.end(), [&](Vec3f aside) {
        const auto near =
            rays.scene().nearest(mesh.centroid(t) + aside, static_cast<float>(reach_m));
        return near && dot(rays.normal(0, near->triangle), n) > 0;
      });
    };
    turned += std::none_of(of_part.begin(), of_part.end(), agrees);
  }
  return turned;
}

/// Directed edges that more than one triangle has: neighbours that face opposite ways, or a third.
inline std::size_t count_doubled_directions(const Mesh& mesh) {
  std::vector<std::uint64_t> edges;
  for (const Triangle& t : mesh.triangles)
    for (int i = 0; i < 3; ++i)
      edges.push_back(static_cast<std::uint64_t>(t[i]) << 32 | t[(i + 1) % 3]);
  std::sort(edges.begin(), edges.end());
  std::size_t doubled = 0;
  for (std::size_t i = 1; i < edges.size(); ++i) doubled += edges[i] == edges[i - 1];
  return doubled;
}

inline std::size_t count_flat(const Mesh& mesh) {  ///< triangles of no area
  std::size_t flat = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    flat += !(length(mesh.area_normal(t)) > 0);
  return flat;
}

/// Every position finite, every corner a vertex.
inline bool is_whole(const Mesh& mesh) {
  return std::all_of(mesh.positions.begin(), mesh.positions.end(), is_finite<float>) &&
         std::all_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const Triangle& t) {
           return std::all_of(t.begin(), t.end(),
                              [&](std::uint32_t v) { return v < mesh.positions.size(); });
         });
}

/// The farthest that any of some vertices, every `step`-th, lies from every part.
inline double farthest_vertex_m(std::span<const kit::Part> parts, const Mesh& mesh,
                                std::size_t step = 4) {
  const Rays all(meshes_of(parts));
  double farthest = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); v += step) {
    const auto near = all.scene().nearest(mesh.positions[v]);
    farthest = std::max(farthest, near ? near->distance_m : 1e9);
  }
  return farthest;
}

/// Border edges as pairs of ends.
inline std::vector<std::pair<Vec3f, Vec3f>> border_of(const Mesh& mesh) {
  const kit::EdgeTable table = kit::edge_table(mesh);
  std::vector<std::pair<Vec3f, Vec3f>> out;
  for (std::uint32_t h = 0; h < table.uses.size(); ++h)
    if (table.uses[h] == 1)
      out.emplace_back(mesh.positions[kit::edge_from(mesh, h)],
                       mesh.positions[kit::edge_to(mesh, h)]);
  return out;
}

/// Root mean square of the distances from one surface to another, the worse way.
inline double two_way_rms_m(const Mesh& a, const Mesh& b, double per_m2 = 1000) {
  const auto one_way = [&](const Mesh& from, const Mesh& to) {
    const Rays rays({&to});
    double sum = 0, count = 0;
    for (const SurfacePoint& p : points_on(from, per_m2)) {
      const double d = rays.scene().nearest(p.point)->distance_m;
      sum += d * d, ++count;
    }
    return std::sqrt(sum / std::max(count, 1.0));
  };
  return std::max(one_way(a, b), one_way(b, a));
}

}  // namespace mr::test
