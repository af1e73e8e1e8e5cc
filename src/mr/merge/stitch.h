#pragma once

#include "mr/merge/border.h"

namespace mr::merge {

struct StitchConfig {
  double reach_m = 0.015;  ///< borders farther apart are not stitched
  double snap_m = 0.004;   ///< vertices this near to an end of an edge take that end
};

/// Sews borders of different parts that run along each other into one line (paper 3.2: close
/// vertices are collapsed): a vertex takes the nearest one of the other border, or is put into its
/// nearest edge, and lies halfway between afterwards. Nothing moves farther than half the reach; no
/// triangle turns over, no edge gets a third triangle: where that would happen, the vertices stay
/// apart. Updates mesh and border. Deterministic.
void stitch(Joined& joined, const StitchConfig& config);

}  // namespace mr::merge
