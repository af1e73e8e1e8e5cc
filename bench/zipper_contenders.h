#pragma once

#include <vector>

#include "race.h"
#include "zipper_case.h"

namespace mr::bench {

/// Points in memory to matches in one run: the search structure is built and asked for every point.
/// The case must outlive them.

Contender match_ours(const BorderPoints& input, int threads);

/// Whether nanoflann was there when this was built.
bool has_nanoflann();

/// "nanoflann/list" asks with radiusSearch(), which lists what it finds, unsorted;
/// "nanoflann/visit" with a result set of its own, which lists nothing. Empty where there is none.
std::vector<Contender> match_nanoflann(const BorderPoints& input, int threads);

/// geometry::KDTreeFlann. Empty where there is no Open3D.
std::vector<Contender> match_open3d(const BorderPoints& input, int threads);

/// The whole of merge::zip().
Contender zip_ours(const Strips& input, int threads);

Message to_message(const Matches& matches);

}  // namespace mr::bench
