#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/simplify/working_mesh.h"

namespace mr::simplify {

/// The meaning of a triangle's label number.
struct Label {
  std::uint32_t chunk = 0;
  SensorId sensor = kNoSensor;

  friend auto operator<=>(const Label&, const Label&) = default;
};

/// Converts a mesh into a WorkingMesh: vertex rings, quadrics, kinds of vertices. Reuses its memory
/// between calls.
class WorkingMeshBuilder {
 public:
  /// `labels`: [T], each under 2^32 - 1, or empty. `weights`: [V], or empty.
  void run(const Mesh& mesh, std::span<const std::uint32_t> labels, std::span<const float> weights,
           WorkingMesh& out);

 private:
  struct OverflowTriangle {
    std::uint32_t v = 0;
    OppositeEdge triangle;
  };
  struct ComplexVertex {
    std::uint32_t v = 0;
    std::vector<OppositeEdge> triangles;
  };

  void assign_triangles(const Mesh& mesh, std::uint32_t ranges);
  std::size_t gather(const Mesh& mesh, std::span<const std::uint32_t> labels, std::uint32_t range,
                     std::vector<OverflowTriangle>& refused, WorkingMesh& out) const;
  static void finish(std::uint32_t range, std::span<const float> weights,
                     std::vector<OverflowTriangle>& refused, std::vector<ComplexVertex>& complex,
                     WorkingMesh& out);

  std::vector<std::uint32_t> list_;   // triangles by range of their vertices
  std::vector<std::uint32_t> first_;  // [ranges + 1] in list_
};

}  // namespace mr::simplify
