#pragma once

#include <array>
#include <cstdint>

#include "mr/simplify/working_mesh.h"

namespace mr::simplify {

/// Half-edge collapses (Garland & Heckbert 1997): a vertex is pulled into the neighbour that costs
/// least. Calls for vertices that share no neighbour may run at once, one EdgeCollapser each.
class EdgeCollapser {
 public:
  explicit EdgeCollapser(WorkingMesh& mesh) : mesh_(mesh) {}

  /// Rates the neighbours that v may go to; the cost of the best. v is neither gone nor fixed.
  float rate(std::uint32_t v);
  /// Pulls the rated vertex into the best neighbour that costs no more than `limit` and errs no
  /// more than `error_m`, if one of the first few may be had. Returns how many triangles vanish.
  std::uint32_t collapse(float limit, float error_m);
  /// Pulls v into its neighbour at place `i` whatever that costs, if that turns
  /// nothing over.
  std::uint32_t collapse_into(std::uint32_t v, std::uint32_t i);
  /// Moves an inner v to where its error is least, if that turns nothing.
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
