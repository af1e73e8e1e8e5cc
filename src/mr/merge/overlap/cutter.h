#pragma once

#include <functional>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::merge {

/// Where an edge is cut, as a fraction of the way from its kept to its lost vertex.
using Crossing = std::function<float(std::uint32_t kept, std::uint32_t lost)>;

/// The part of a mesh around the vertices that are kept ([V], not 0). Crossed triangles are cut at
/// one point of each edge, so that neighbours still share vertices. A cut very near a vertex snaps
/// to it, to avoid slivers.
struct Cut {
  /// Where a vertex lies: a share of the way from one vertex of the input to another.
  struct Place {
    std::uint32_t from = 0, to = 0;
    float share = 0;
  };

  Mesh mesh;                          ///< without views
  std::vector<std::uint32_t> parent;  ///< [T] triangle of the input
  std::vector<Place> places;          ///< [V]
};
Cut cut_at(const Mesh& mesh, const std::vector<std::uint8_t>& keep, const Crossing& crossing);

}  // namespace mr::merge
