#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/simplify/shrinking_mesh.h"

namespace mr::simplify {

/// What the triangles of one label have in common.
struct Label {
  std::uint32_t chunk = 0;
  SensorId sensor = kNoSensor;

  friend auto operator<=>(const Label&, const Label&) = default;
};

/// A mesh made ready to shrink: rings, planes, borders. Keeps its memory from call to call.
class Builder {
 public:
  /// `labels`: [T], each under 2^32 - 1, or empty. `weights`: [V], or empty. Both may go
  /// afterwards.
  void run(const Mesh& mesh, std::span<const std::uint32_t> labels, std::span<const float> weights,
           ShrinkingMesh& out);

 private:
  struct Refused {
    std::uint32_t v = 0;
    Opposite triangle;
  };
  struct Complex {
    std::uint32_t v = 0;
    std::vector<Opposite> triangles;
  };

  void assign_triangles(const Mesh& mesh, std::uint32_t ranges);
  std::size_t gather(const Mesh& mesh, std::span<const std::uint32_t> labels, std::uint32_t range,
                     std::vector<Refused>& refused, ShrinkingMesh& out) const;
  static void finish(std::uint32_t range, std::span<const float> weights,
                     std::vector<Refused>& refused, std::vector<Complex>& complex,
                     ShrinkingMesh& out);

  std::vector<std::uint32_t> list_;   // triangles by range of their vertices
  std::vector<std::uint32_t> first_;  // [ranges + 1] in list_
};

}  // namespace mr::simplify
