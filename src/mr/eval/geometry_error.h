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
  std::vector<HalfSpace> captured{};  ///< only the reference in their intersection counts
};

/// The view frustum of a depth camera: determines which part of the reference it could capture.
struct SensorFrustum {
  Camera depth_camera;  ///< undistorted
  Pose T_world_depth;
  double near_m = 0.3, far_m = 5;
};

/// The geometric error of a mesh (docs/evaluation.md, Geometry).
struct GeometryError {
  SurfaceDistance to_reference;    ///< from the mesh to the reference
  SurfaceDistance from_reference;  ///< from the reference that sensors see to the mesh
  double seen_ratio = 0;           ///< share of the reference that sensors see
  double duplicate_ratio = 0;      ///< share of samples with a second sheet within three voxels
  double missing_ratio = 0;        ///< share of the seen reference with nothing within a voxel
  std::uint64_t nonmanifold_edges = 0, components = 0;
  double seam_gap_p95_mm = 0;  ///< width of the gaps between borders that face each other
  double boundary_m = 0;
};

/// Computes all measures. The mesh is welded by exact position first. With no `frustums`, all of
/// the reference that lies in `captured` counts as seen. The same on any number of threads.
/// invalid: a position is not finite or over 10 km away, or an index has no vertex; empty: one of
/// the surfaces has no area, or no sensor sees the reference.
Result<GeometryError> geometry_error(const Mesh& mesh, const Mesh& reference,
                                     std::span<const SensorFrustum> frustums,
                                     const GeometryConfig& config);

/// Residual between the surfaces of two sensors where they overlap: the area-weighted RMS
/// point-to-surface distance over samples of either surface for which the other lies within 5
/// voxels and has a similar normal. A sample whose nearest point is on the other's border is not
/// part of the overlap. -1 when they share less than 1 % of the smaller surface.
double residual_mm(const Mesh& a, const Mesh& b, const GeometryConfig& config);

// The steps, declared for the tests. Meshes must have finite positions and valid indices, and be
// welded where edges matter.

struct SurfaceSample {
  Vec3f position, normal;  ///< of the triangle, unit length
  std::uint32_t triangle = 0;
};
/// Stratified sampling, uniform by area; deterministic for a seed. Empty if the mesh has no area.
std::vector<SurfaceSample> sample_surface(const Mesh& mesh, int samples, std::uint64_t seed);

/// Distances from `from` to `to`; all 0 when either surface has no area.
SurfaceDistance surface_distance(const Mesh& from, const Mesh& to, int samples, std::uint64_t seed);

/// Distances from samples of a surface to the nearest point of another, only of those whose nearest
/// triangle is marked.
SurfaceDistance distance_to_marked(const Mesh& from, const Mesh& to,
                                   std::span<const std::uint8_t> marked, int samples,
                                   std::uint64_t seed);

/// Fraction of the area with a second layer within three voxels along the normal, in front or
/// behind, whose normal is within 60 degrees. Triangles that share a vertex belong to the same
/// layer.
double duplicate_ratio(const Mesh& mesh, const GeometryConfig& config);

/// For every sample of `surface` 1 if some sensor sees it: it projects into the sensor's picture,
/// lies between near and far, faces the sensor (cosine over 0.1, so not within 6 degrees of
/// grazing), and the ray to it is unoccluded but for its last `tolerance_m`.
std::vector<std::uint8_t> seen_samples(const Mesh& surface, std::span<const SurfaceSample> samples,
                                       std::span<const SensorFrustum> frustums, double tolerance_m);

/// Width of the gaps between borders: the 95th percentile, by length, of the distance from border
/// edges to the border that faces them within six voxels; 0 when no borders face each other. Two
/// edges face each other when they run in opposite directions with their open sides together, and
/// when the path between them along the border is longer than three voxels and than three times the
/// gap: jagged borders and round holes are not gaps.
double seam_gap_p95_mm(const Mesh& mesh, double voxel_m);

/// Total length of the border: edges with one triangle.
double boundary_length_m(const Mesh& mesh);

}  // namespace mr::eval
