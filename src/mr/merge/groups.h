#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::merge {

/// The connected components of meshes under "comes within `reach_m`", so that, for example, the
/// rooms of a building are merged independently. Conservative: pairs a few times farther apart may
/// count, too, and up to six meshes are always one group. Returns indices, ascending within a
/// group, groups by their first. Hash grid and union-find; parallel; deterministic.
std::vector<std::vector<std::uint32_t>> connected_groups(std::span<const Mesh* const> meshes,
                                                         double reach_m);

}  // namespace mr::merge
