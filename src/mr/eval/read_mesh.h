#pragma once

#include <filesystem>

#include "mr/core/mesh.h"
#include "mr/core/result.h"

namespace mr::eval {

/// Reads a binary little-endian PLY file: float x, y, z of its vertices, and faces as a list of
/// vertex indices, of which those with more than three corners are cut into a fan. Other properties
/// and elements are skipped. What model::export_scene has turned (a comment T_file_world) is turned
/// back into the world. not_found, io; too_large: over 1 GiB; unsupported: another PLY;
/// corrupt: cut off, an index without vertex, a position that is not finite. Messages name the
/// file and the place.
Result<Mesh> read_ply(const std::filesystem::path& file);

}  // namespace mr::eval
