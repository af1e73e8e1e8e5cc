#pragma once

#include <filesystem>

#include "mr/core/decoded_scene.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"

namespace mr::model {

/// World → exported file: the shortest turn that brings the scene's `up` (unit length) to +Y, which
/// glTF demands. The origin stays.
Pose T_file_world(Vec3d up);

/// Writes one capture for other tools, standing the same way in all formats (T_file_world), by the
/// file's ending; no partial file is left on failure:
///   .glb  binary glTF 2.0: one mesh, a primitive per texture stream with baked coordinates
///         (PNG embedded, KHR_materials_unlit), one with COLOR_0 for the background, one without
///         texture for triangles of no view; vertices in the world frame, which a root node turns
///   .ply  binary little-endian, vertices with colour sampled from the textures or the background's
///         own; a comment holds T_file_world
///   .obj  with .mtl and one PNG per texture stream beside it; no colours for the background
/// Corners of a triangle that meet in one vertex but lie in different views become several
/// vertices. Errors: unsupported ending, empty scene, io.
Status export_scene(const DecodedScene& scene, Vec3d up, const std::filesystem::path& file);

}  // namespace mr::model
