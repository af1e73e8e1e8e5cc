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

/// Masks of the pixels in the ground truth's pictures whose surface some depth camera has seen
/// since the beginning of the warm-up (the metric `seen`): [moments][views], 1 there. Visibility
/// is sampled every tenth capture and every fourth pixel in x and y. A moving surface counts as
/// seen only if it is seen at the moment itself. Cached in `eval_cache` unless that is empty. The
/// scene must be prepared. unsupported: the scene has no known ground truth.
Result<std::vector<std::vector<ImageMask>>> seen_masks(const Scene& scene, const Moments& moments,
                                                       const std::vector<std::size_t>& wanted,
                                                       const std::vector<render::Viewpoint>& views,
                                                       const std::filesystem::path& eval_cache,
                                                       const Progress& progress = {});

}  // namespace mr::eval
