#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/mesh.h"
#include "mr/kit/part.h"
#include "mr/node/layers.h"

namespace mr::node {

/// Merges cube by cube of the chunk grid: after the first time, only what lies around chunks that
/// changed is merged again, and the rest is what it was. A chunk that was kept is the very same
/// object. Where the new surface does not meet the old one edge by edge, all is merged.
class CubeMerger {
 public:
  /// What calibration does to the parts of the scenes, point by point.
  using Correct = std::function<void(std::vector<kit::Part>& parts)>;
  /// Overlap removal, zipper and islands; `all`: of the whole scene, not of a piece.
  using Merge = std::function<Mesh(const std::vector<kit::Part>& parts, bool all)>;

  /// `reach_m`: how far away a change can still be felt.
  CubeMerger(double chunk_m, double reach_m);

  /// The merged surface of some scenes, whose whole surfaces, corrected, are `parts`.
  Mesh run(const std::vector<DecodedScene>& scenes, const std::vector<kit::Part>& parts,
           const Correct& correct, const Merge& merge);

  /// The next time all is merged.
  void forget() { last_.reset(); }

  /// Of the last run: all cubes, and those that were merged.
  std::size_t cubes() const { return cubes_; }
  std::size_t merged_cubes() const { return merged_; }

 private:
  using Cubes = std::set<Vec3i>;
  /// Whose chunks lie in each cube.
  using Contents = std::map<Vec3i, std::vector<std::pair<std::size_t, const Chunk*>>>;
  struct Last {
    std::vector<DecodedScene> scenes;  // without textures; holds the chunks
    Contents contents;
    Mesh mesh;
  };

  bool is_like_last(const std::vector<DecodedScene>& scenes) const;
  Cubes changed(const Contents& contents) const;
  Cubes grown(const Cubes& cubes) const;
  /// The new surface, if it meets the old one.
  std::optional<Mesh> mend(const std::vector<DecodedScene>& scenes, const Cubes& again,
                           const Correct& correct, const Merge& merge) const;

  double chunk_m_;
  int rings_;
  std::optional<Last> last_;
  std::size_t cubes_ = 0, merged_ = 0;
};

}  // namespace mr::node
