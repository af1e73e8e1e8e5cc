#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"

namespace mr::eval {

/// Distances from samples of one surface to the nearest point of another, in millimetres.
struct SurfaceDistance {
  double mean_mm = 0, rms_mm = 0, p95_mm = 0, max_mm = 0;
};

/// Where dot(normal, p) >= least_m.
struct HalfSpace {
  Vec3d normal;
  double least_m = 0;
};

struct GeometryConfig {
  double voxel_m = 0.01;
  int samples = 200'000;  ///< per surface, spread by area
  std::uint64_t seed = 1;
  std::vector<HalfSpace> captured{};  ///< the reference need not be met outside any of these
};

/// What a depth camera may see; for the share of the reference that could have been captured.
struct SensorFrustum {
  Camera depth_camera;  ///< undistorted
  Pose T_world_depth;
  double near_m = 0.3, far_m = 5;
};

/// EVALUATION, Geometry.
struct GeometryError {
  SurfaceDistance to_reference;    ///< from the mesh to the reference
  SurfaceDistance from_reference;  ///< from what the sensors see of the reference to the mesh
  double seen_ratio = 0;           ///< share of the reference that this is
  double duplicate_ratio = 0;      ///< share of samples with a second sheet within three voxels
  double missing_ratio = 0;        ///< share of the seen reference with nothing within a voxel
  std::uint64_t nonmanifold_edges = 0, components = 0;
  double seam_gap_p95_mm = 0;  ///< width of the gaps between borders that face each other
  double boundary_m = 0;
};

/// All of it. The mesh is welded by exact position first. With no `frustums`, all of the reference
/// that lies in `captured` counts as seen. The same on any number of threads. invalid: a position
/// is not finite or over 10 km away, or an index has no vertex; empty: one of the surfaces has no
/// area, or no sensor sees the reference.
Result<GeometryError> geometry_error(const Mesh& mesh, const Mesh& reference,
                                     std::span<const SensorFrustum> frustums,
                                     const GeometryConfig& config);

/// How far apart two sensors' surfaces lie where both see the same: the RMS point-to-surface
/// distance over samples of either with the other within 5 voxels and facing alike, by area; a
/// sample that lies beside the other's border is not of what both see. -1 where they share less
/// than 1 % of the smaller one.
double residual_mm(const Mesh& a, const Mesh& b, const GeometryConfig& config);

// The parts, each of which tests check on its own. Meshes are finite, with sound indices; where
// edges matter, welded.

struct SurfaceSample {
  Vec3f position, normal;  ///< of the triangle, unit length
  std::uint32_t triangle = 0;
};
/// Spread evenly by area: stratified, the same for the same seed. None where there is no area.
std::vector<SurfaceSample> sample_surface(const Mesh& mesh, int samples, std::uint64_t seed);

/// All 0 where either surface has no area.
SurfaceDistance surface_distance(const Mesh& from, const Mesh& to, int samples, std::uint64_t seed);

/// Distances from samples of a surface to the nearest point of another, only of those whose nearest
/// triangle is marked.
SurfaceDistance distance_to_marked(const Mesh& from, const Mesh& to,
                                   std::span<const std::uint8_t> marked, int samples,
                                   std::uint64_t seed);

/// Share of the area with a second sheet within three voxels along the normal, either way, whose
/// normal is within 60 degrees. A triangle that shares a vertex is of the same sheet.
double duplicate_ratio(const Mesh& mesh, const GeometryConfig& config);

/// For every sample of `surface` whether a sensor sees it: it lies in its picture, between near and
/// far, is met at more than 6 degrees from grazing (cosine over 0.1) from its outer side, and no
/// more than `tolerance_m` of the way to it lies behind other surface.
std::vector<std::uint8_t> seen_samples(const Mesh& surface, std::span<const SurfaceSample> samples,
                                       std::span<const SensorFrustum> frustums, double tolerance_m);

/// 95th percentile, by length, of the distance from border edges to the border that faces them
/// within six voxels; 0 where no borders face each other. Faces: it lies across the open side, runs
/// the other way, and is not joined to it by a way along the border that is under three voxels or
/// three times as long as the way across: teeth and round holes are no gaps.
double seam_gap_p95_mm(const Mesh& mesh, double voxel_m);

/// Total length of the edges that one triangle uses.
double boundary_length_m(const Mesh& mesh);

}  // namespace mr::eval
