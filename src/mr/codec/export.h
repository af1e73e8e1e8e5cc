#pragma once

#include <filesystem>

#include "mr/core/decoded_scene.h"
#include "mr/core/result.h"

namespace mr::codec {

/// Writes one capture for other tools, by the file's ending; no partial file is left on failure:
///   .glb  binary glTF 2.0: one mesh, a primitive per texture stream with baked coordinates
///         (PNG embedded, KHR_materials_unlit), one with COLOR_0 for the background, one without
///         texture for triangles of no view;
///         a root node turns the scene's `up` to glTF's +Y
///   .ply  binary little-endian, world frame, vertices with colour sampled from the textures or the
///         background's own
///   .obj  with .mtl and one PNG per texture stream beside it; no colours for the background
/// Corners of a triangle that meet in one vertex but lie in different views become several
/// vertices. Errors: unsupported ending, empty scene, io.
Status export_scene(const DecodedScene& scene, Vec3d up, const std::filesystem::path& file);

}  // namespace mr::codec
