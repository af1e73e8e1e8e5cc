#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/kit/pair_map.h"

namespace mr::atlas {

/// Which view textured the surface at a place: the labels of an earlier mesh in a hash grid of
/// 4 cm, so that a surface made anew keeps its views. Immutable.
class LabelHistory {
 public:
  LabelHistory() : cells_(0) {}
  /// `mesh`: with runs.
  explicit LabelHistory(const Mesh& mesh);

  /// The view of most of the surface in the cell of a point, or in the nearest of the six cells
  /// beside it; kNoView: there was none.
  ViewId at(Vec3f p) const;

 private:
  static constexpr float kCell_m = 0.04f;

  kit::PairMap cells_;         ///< cell → place in `views_`
  std::vector<ViewId> views_;  ///< of the first cell on
};

}  // namespace mr::atlas
