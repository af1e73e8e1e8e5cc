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

/// Where a vertex may go.
enum class VertexKind : std::uint8_t {
  inner,   ///< to any neighbour
  border,  ///< along the real border that it lies on
  crease,  ///< along the line between triangles of different labels
  fixed,   ///< nowhere
};

inline constexpr float kNever = std::numeric_limits<float>::infinity();

/// The mesh while it shrinks: flat arrays by vertex. Vertices are worked on by ranges of their
/// numbers.
struct WorkingMesh {
  static constexpr std::uint32_t kRange = 8192;

  VertexRings rings;
  std::vector<VertexPosition> places;
  std::vector<Quadric> quadrics;
  std::vector<VertexKind> kinds;
  std::vector<float> next;          ///< cost below which a vertex need not be looked at
  std::vector<std::uint8_t> spans;  ///< 1: its triangles may reach out of its range
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
  /// Calls work(range) for all of them, some at once.
  template <typename Work>
  void for_each_range(const Work& work) const {
    parallel_for(ranges(), 1, [&](std::size_t first, std::size_t last) {
      for (auto range = static_cast<std::uint32_t>(first); range < last; ++range) work(range);
    });
  }
  /// Whether v, which is not complex, has neighbours in other ranges.
  bool reaches_out(std::uint32_t v) const {
    bool out = false;
    for (std::uint32_t i = 0; i < rings.size(v); ++i)
      out |= rings.ring(v)[i] / kRange != v / kRange;
    return out;
  }
};

}  // namespace mr::simplify
