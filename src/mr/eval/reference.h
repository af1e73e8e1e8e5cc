#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/result.h"
#include "mr/eval/draw_scene.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// The reference of a comparison (docs/evaluation.md, Pictures).
enum class ReferenceKind {
  truth,      ///< of a synthetic scene: its noiseless surface and colours
  monolithic  ///< all sensors in one 1 cm grid, textured from uncompressed pictures
};
const char* to_string(ReferenceKind kind);

/// The synthetic rig whose ground truth is known: the scene's own, or the one its pictures were
/// rendered with; null for real scenes.
const RigConfig* known_rig(const Scene& scene);
Error no_truth(const Scene& scene);  ///< unsupported: the error for a scene without one

/// The ground truth if the scene's rig is known, else monolithic.
ReferenceKind default_reference(const Scene& scene);

using Progress = std::function<void(std::size_t done, std::size_t of)>;

/// Renders the reference from every viewpoint at the given captures: [frames][views]. The scene
/// must be prepared. Pictures of ground truth are cached in `eval_cache` unless that is empty.
/// unsupported: truth of a scene without a known rig; empty: a capture is missing or has no
/// surface.
Result<std::vector<std::vector<RenderedView>>> reference_pictures(
    const Scene& scene, ReferenceKind kind, const std::vector<int>& frames,
    const std::vector<render::Viewpoint>& views, const std::filesystem::path& rig_cache,
    const std::filesystem::path& eval_cache, const Progress& progress = {});

/// The monolithic reference of one capture, as a client would draw it.
/// empty: it holds no surface.
Result<DecodedScene> monolithic_scene(const Scene& scene, std::span<const Frame> capture);

}  // namespace mr::eval
