#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mr/sensor/recording_formats.h"

namespace mr {

/// A scene file of what was imported, with comments. Paths below the folder that the file is to lie
/// in, or at most two folders beside it, become relative to it; others absolute. `folder` and the
/// paths of the scene: absolute, without symbolic links.
std::string scene_text(const sensor::ImportedScene& scene, const std::filesystem::path& folder);

/// Several recordings as one rig: their sensors get ids of their own, the fastest tells fps, the
/// first that knows it tells what is up. At least one.
sensor::ImportedScene one_scene(std::vector<sensor::ImportedScene> scenes);

}  // namespace mr
