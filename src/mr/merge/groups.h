#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::merge {

/// Which meshes may touch each other: two are of one group where their surfaces come within
/// `reach_m` (some a few times as far apart count, too), or when a chain of others joins them. So
/// the rooms of a building are merged apart from each other. Returns their places, ascending in a
/// group, groups by their first. Few meshes are one group without a look. Parallel; deterministic.
std::vector<std::vector<std::uint32_t>> connected_groups(std::span<const Mesh* const> meshes,
                                                         double reach_m);

}  // namespace mr::merge
