#pragma once

#include <cstdint>
#include <vector>

#include "mr/atlas/labels.h"

namespace mr::atlas {

/// The due triangles of a surface with the neighbourhood that their labels depend on, so that the
/// cost does not depend on the size of the whole surface.
struct DuePart {
  Labelling labelling;                ///< origins: indices of the whole surface's triangles
  std::vector<std::uint32_t> vertex;  ///< [V] of the part → of the whole

  /// `rings`: of triangles around the due ones.
  DuePart(const Labelling& whole, int rings);
  /// Writes the split triangles and labels back into the whole surface.
  void put_back(Labelling& whole);
};

/// Makes due, in place of what was due and has been labelled, the regions beside it that are
/// smaller than `least_m2`: mostly what is left of one whose other part took another view. A
/// region: connected triangles of one label. False: there are none.
bool mark_fragments(Labelling& surface, double least_m2);

}  // namespace mr::atlas
