#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/kit/pair_map.h"

namespace mr::kit {

/// The vertices around an open border, with the surface on their left and the gap on their right.
using BorderLoop = std::vector<std::uint32_t>;

/// The open borders of a mesh. Only triangles at borders are looked at closely, so that a mesh with
/// few of them costs little.
class Borders {
 public:
  /// The mesh must outlive the constructor only.
  explicit Borders(const Mesh& mesh);

  /// Where borders meet in a vertex each goes on around the triangles that it is the border of; one
  /// that passes a vertex twice is two loops. No loop has a vertex twice. Ordered by the mesh's
  /// triangles.
  const std::vector<BorderLoop>& loops() const { return loops_; }
  /// Whether two vertices of borders have an edge.
  bool has_edge(std::uint32_t a, std::uint32_t b) const {
    return half_edges_.find(key(a, b)) || half_edges_.find(key(b, a));
  }
  /// Of a triangle that closes a gap.
  void add_edge(std::uint32_t from, std::uint32_t to) { half_edges_.get_or_add(key(from, to), 0); }

 private:
  static std::uint64_t key(std::uint32_t from, std::uint32_t to) {
    return static_cast<std::uint64_t>(from) << 32 | to;
  }
  void find_half_edges(const Mesh& mesh, std::vector<std::uint32_t>& starts);
  std::uint32_t next_on_border(const Mesh& mesh, std::uint32_t half_edge) const;

  PairMap half_edges_{1024};  ///< at vertices of borders, by their ends; of several, kMany
  std::vector<BorderLoop> loops_;
};

}  // namespace mr::kit
