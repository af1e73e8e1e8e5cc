#pragma once

#include <array>
#include <cstdint>

#include "mr/simplify/working_mesh.h"

namespace mr::simplify {

/// Half-edge collapses with quadric error metrics (Garland and Heckbert 1997): a vertex is merged
/// into its cheapest neighbour. Calls for vertices that share no neighbour may run at once, one
/// EdgeCollapser each.
class EdgeCollapser {
 public:
  explicit EdgeCollapser(WorkingMesh& mesh) : mesh_(mesh) {}

  /// Computes the costs of collapsing v into each of its neighbours; returns the lowest. v must be
  /// alive and not fixed.
  float rate(std::uint32_t v);
  /// Collapses the rated vertex into its cheapest admissible neighbour, trying the first few, with
  /// a cost of at most `limit` and an error of at most `error_m`. Returns the number of triangles
  /// removed, 0 if there is no such neighbour.
  std::uint32_t collapse(float limit, float error_m);
  /// Collapses v into its neighbour with index `i` whatever the cost, unless that flips a triangle.
  std::uint32_t collapse_into(std::uint32_t v, std::uint32_t i);
  /// Moves an interior vertex to the minimum of its quadric, unless that flips a triangle.
  void relax(std::uint32_t v);

 private:
  using Floats = std::array<float, VertexRings::kMost>;

  void load(std::uint32_t v);
  float choose();
  void measure_triangles();
  bool keeps_shape(std::uint32_t u, Vec3f to, float most_turn2);
  bool errs_more(std::uint32_t i, float error_m) const;
  std::uint32_t collapse_along(std::uint32_t i);

  WorkingMesh& mesh_;
  Neighbourhood near_;
  std::uint32_t best_ = 0;
  alignas(16) Floats error_{}, cost_{};  // by neighbour
  bool measured_ = false;
  float least_quality2_ = 0;
  alignas(16) Floats nx_{}, ny_{}, nz_{}, area2_{};  // by triangle, before
};

}  // namespace mr::simplify
