#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/simplify/neighbourhood.h"
#include "mr/simplify/quadric.h"
#include "mr/simplify/vertex_rings.h"

namespace mr::simplify {

/// The collapses that a vertex allows.
enum class VertexKind : std::uint8_t {
  inner,   ///< into any neighbour
  border,  ///< along its open border
  crease,  ///< along the line between two labels
  fixed,   ///< none
};

inline constexpr float kNever = std::numeric_limits<float>::infinity();

/// The mesh during decimation: structure of arrays by vertex. Vertices are processed in parallel by
/// ranges of their numbers.
struct WorkingMesh {
  static constexpr std::uint32_t kRange = 8192;

  VertexRings rings;
  std::vector<VertexPosition> places;
  std::vector<Quadric> quadrics;
  std::vector<VertexKind> kinds;
  std::vector<float> next;          ///< lower bound of its next collapse's cost
  std::vector<std::uint8_t> spans;  ///< 1: may have neighbours in other ranges
  std::size_t triangles = 0;

  void resize(std::size_t vertices, bool labels) {
    rings.start(vertices, labels);
    places.resize(vertices), quadrics.resize(vertices), kinds.resize(vertices);
    next.resize(vertices), spans.resize(vertices);
  }
  std::uint32_t vertices() const { return static_cast<std::uint32_t>(places.size()); }
  std::uint32_t ranges() const { return (vertices() + kRange - 1) / kRange; }
  std::uint32_t begin(std::uint32_t range) const { return range * kRange; }
  std::uint32_t end(std::uint32_t range) const {
    return range + 1 < ranges() ? (range + 1) * kRange : vertices();
  }
  /// Calls work(range) for every range, in parallel.
  template <typename Work>
  void for_each_range(const Work& work) const {
    parallel_for(ranges(), 1, [&](std::size_t first, std::size_t last) {
      for (auto range = static_cast<std::uint32_t>(first); range < last; ++range) work(range);
    });
  }
  /// Whether v, which must not be complex, has neighbours in other ranges.
  bool reaches_out(std::uint32_t v) const {
    bool out = false;
    for (std::uint32_t i = 0; i < rings.size(v); ++i)
      out |= rings.ring(v)[i] / kRange != v / kRange;
    return out;
  }
};

}  // namespace mr::simplify
