#pragma once

#include <array>
#include <span>
#include <vector>

#include "mr/core/lattice.h"
#include "mr/core/mesh.h"
#include "mr/kit/part.h"

namespace mr::merge {

struct HolesConfig {
  double fill_m = 0.05;  ///< width of the widest hole that is closed; 0: none is
  double voxel_m = 0.01;
  Lattice lattice{};  ///< of the mesh's vertices
  /// Where a sensor confirms its still surface, it saw through: of a moving surface.
  bool is_moving = false;
};

/// The corners of a triangle that no sensor measured.
using GuessedTriangle = std::array<Vec3f, 3>;

/// Closes holes of a merged surface smoothly, all of a hole or nothing. A hole is closed where
/// - no triangle over it is wider than `fill_m`,
/// - both rims agree: every triangle faces nearly as the surface at its corners does,
/// - it holds no other surface, and
/// - no sensor saw through it.
/// Triangulation by least area (Barequet and Sharir 1995; Liepa 2003); a wide, bent hole gets a
/// vertex in its middle, at the height that a sphere, a cylinder or a paraboloid has there. New
/// triangles have the sensor of their rim. Returns the new triangles. `parts`: what was merged.
/// Parallel; deterministic.
std::vector<GuessedTriangle> close_holes(Mesh& mesh, std::span<const kit::Part> parts,
                                         const HolesConfig& config);

}  // namespace mr::merge
