#pragma once

#include "atlas_case.h"
#include "race.h"

namespace mr::bench {

/// Contenders of view selection. The case must outlive them. The result holds the labelled surface:
/// positions, triangles, and one view's index per triangle (-1: none).

/// atlas::label_triangles; the still surface's depth maps are made before.
Contender atlas_ours(const AtlasCase& input, int threads);

/// View selection of Waechter et al. 2014 (baseline/waechter.h). Data terms on all threads, the
/// graph cut on one. The still surface's triangles are in the ray caster, which is built before.
Contender atlas_waechter(const AtlasCase& input, int threads);

/// Adds a labelled surface to a result.
Message label_message(const Mesh& surface, const std::vector<int>& label);

}  // namespace mr::bench
