#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/merge/holes/close_holes.h"

namespace mr::merge {

/// Tells which triangles of a surface were guessed, by their places: they may have been cut since.
class GuessedSurface {
 public:
  GuessedSurface() = default;
  /// `tolerance_m`: how far off cuts may have moved them; a few steps of the lattice.
  GuessedSurface(std::vector<GuessedTriangle> triangles, double tolerance_m);

  bool empty() const { return triangles_.empty(); }
  /// [T] 1: guessed; empty where none is.
  std::vector<std::uint8_t> marks(const Mesh& mesh) const;

 private:
  bool has(Vec3f p) const;

  float tolerance_m_ = 0;
  std::vector<GuessedTriangle> triangles_;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> by_cell_;  // sorted; triangles near a cell
  std::vector<std::uint32_t> large_;                              ///< triangles in too many cells
};

}  // namespace mr::merge
