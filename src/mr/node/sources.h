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

/// Opens the sources of the wanted sensors of a scene, in that order. A rig's sensors must have
/// been filled in (prepare_scene); they share the room, and the cache of rendered pictures where
/// `cache_folder` is not empty. `rendering` tells how far that is.
std::vector<std::unique_ptr<FrameSource>> open_sources(
    const Scene& scene, std::span<const SensorId> wanted,
    const std::filesystem::path& cache_folder = {},
    std::function<void(int done, int of)> rendering = {});

/// The chunks of the scene's background model; none where it has no background. Errors name the
/// file. `notice` is told in
/// one line what was done to it.
Result<std::vector<EncodedChunk>> open_background(
    const Scene& scene, const std::function<void(const std::string&)>& notice = {});

/// A scene whose rig, if it has one, is turned into its sensors. empty: it has none. invalid: the
/// first of its problems(); a scene that load_scene() accepts has none.
Result<Scene> prepare_scene(Scene scene);

}  // namespace mr::node
