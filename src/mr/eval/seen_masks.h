#pragma once

#include <filesystem>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/result.h"
#include "mr/eval/moments.h"
#include "mr/eval/reference.h"
#include "mr/render/renderer.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// Which pixels of a truth's pictures show surface that some depth camera has seen by then, from
/// the beginning of the warm-up on (EVALUATION, `seen`): [moments][views], 1 there. It is looked at
/// every tenth capture and at every fourth pixel each way; what moves counts as seen where it is
/// seen now. Kept in `eval_cache`, where that is not empty. The scene must be prepared.
/// unsupported: its truth is not known.
Result<std::vector<std::vector<ImageMask>>> seen_masks(const Scene& scene, const Moments& moments,
                                                       const std::vector<std::size_t>& wanted,
                                                       const std::vector<render::Viewpoint>& views,
                                                       const std::filesystem::path& eval_cache,
                                                       const Progress& progress = {});

}  // namespace mr::eval
