#pragma once

#include <vector>

#include "race.h"
#include "zipper_case.h"

namespace mr::bench {

/// Contenders of matching border points: one run builds the search structure and queries it for
/// every point. The case must outlive them.

Contender match_ours(const BorderPoints& input, int threads);

/// Whether this was built with nanoflann.
bool has_nanoflann();

/// "nanoflann/list" uses radiusSearch(), which returns an unsorted list; "nanoflann/visit" a custom
/// result set without a list. Empty: built without nanoflann.
std::vector<Contender> match_nanoflann(const BorderPoints& input, int threads);

/// geometry::KDTreeFlann. Empty: built without Open3D.
std::vector<Contender> match_open3d(const BorderPoints& input, int threads);

/// Complete merge::zip().
Contender zip_ours(const Strips& input, int threads);

Message to_message(const Matches& matches);

}  // namespace mr::bench
