#pragma once

#include <filesystem>

#include "mr/core/mesh.h"
#include "mr/core/result.h"

namespace mr::eval {

/// Reads a binary little-endian PLY file: float x, y, z of its vertices, and faces as a list of
/// vertex indices, which are triangulated as fans. Other properties and elements are skipped. A
/// transform by model::export_scene (comment T_file_world) is undone, so the mesh is in the world
/// frame. not_found, io; too_large: over 1 GiB; unsupported: another PLY; corrupt: cut off, an
/// index without vertex, a position that is not finite. Messages name the file and the place.
Result<Mesh> read_ply(const std::filesystem::path& file);

}  // namespace mr::eval
