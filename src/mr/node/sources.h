#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mr/core/chunk.h"
#include "mr/core/frame_source.h"
#include "mr/core/result.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// Opens the sources of the wanted sensors of a scene, in that order. The scene must be prepared
/// (prepare_scene). Sensors of a synthetic rig share the room model and, if `cache_folder` is not
/// empty, a cache of rendered pictures. `rendering` reports the progress of rendering.
std::vector<std::unique_ptr<FrameSource>> open_sources(
    const Scene& scene, std::span<const SensorId> wanted,
    const std::filesystem::path& cache_folder = {},
    std::function<void(int done, int of)> rendering = {});

/// The chunks of the scene's background model; empty: the scene has none. Errors name the file.
/// `notice` receives one line about each conversion of the model.
Result<std::vector<EncodedChunk>> open_background(
    const Scene& scene, const std::function<void(const std::string&)>& notice = {});

/// Replaces the scene's synthetic rig, if it has one, by the sensors of the rig. Errors: empty: the
/// scene has no sensor; invalid: the first of the scene's problems() (scenes from load_scene() have
/// none).
Result<Scene> prepare_scene(Scene scene);

}  // namespace mr::node
