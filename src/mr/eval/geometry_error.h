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

struct GeometryConfig {
  double voxel_m = 0.01;
  int samples = 200'000;  ///< per surface, spread by area
  std::uint64_t seed = 1;
};

/// What a depth camera may see; for the share of the reference that could have been captured.
struct Eyes {
  Camera depth_camera;  ///< undistorted pinhole
  Pose T_world_depth;
  double near_m = 0.3, far_m = 5;
};

/// EVALUATION, Geometry.
struct GeometryError {
  SurfaceDistance to_reference;    ///< from the mesh to the reference
  SurfaceDistance from_reference;  ///< from what the sensors see of the reference to the mesh
  double duplicate_ratio = 0;      ///< share of samples with a second sheet within three voxels
  double missing_ratio = 0;        ///< share of the seen reference with nothing within a voxel
  std::uint64_t nonmanifold_edges = 0, components = 0;
  double seam_gap_p95_mm = 0;  ///< width of the gaps between borders that face each other
  double boundary_m = 0;
};

/// All of it. The mesh is welded by exact position first. With no `eyes`, all of the reference
/// counts as seen. invalid: a position is not finite; empty: one of the surfaces has no area.
Result<GeometryError> geometry_error(const Mesh& mesh, const Mesh& reference,
                                     std::span<const Eyes> eyes, const GeometryConfig& config);

/// How far apart two sensors' surfaces lie where both see the same: the RMS point-to-surface
/// distance over samples of either with the other within 5 voxels and facing alike; -1 where they
/// share less than 1 % of the smaller one.
double residual_mm(const Mesh& a, const Mesh& b, const GeometryConfig& config);

// The parts, each of which tests check on its own.

struct SurfaceSample {
  Vec3f position, normal;  ///< of the triangle, unit length
  std::uint32_t triangle = 0;
};
/// Spread evenly by area: stratified, the same for the same seed.
std::vector<SurfaceSample> sample_surface(const Mesh& mesh, int samples, std::uint64_t seed);

SurfaceDistance surface_distance(const Mesh& from, const Mesh& to, int samples, std::uint64_t seed);

/// Share of the area with a second sheet within three voxels along the normal, either way, whose
/// normal is within 60 degrees.
double duplicate_ratio(const Mesh& mesh, const GeometryConfig& config);

/// 95th percentile, by length, of the distance from border edges to the border that faces them
/// within six voxels; 0 where no borders face each other.
double seam_gap_p95_mm(const Mesh& mesh, double voxel_m);

/// Total length of the edges that one triangle uses.
double boundary_length_m(const Mesh& mesh);

}  // namespace mr::eval
