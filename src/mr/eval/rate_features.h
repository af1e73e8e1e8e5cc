#pragma once

#include <optional>
#include <vector>

#include "mr/core/frame.h"
#include "mr/rate/sweep.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// The features of a burst of captures ([captures][sensors]) that models of rate control are fed:
/// those of the last capture, given the ones before, mean over the sensors that delivered; of
/// colour, over those that have it.
std::vector<rate::Feature> burst_features(
    const Scene& scene, const std::vector<std::vector<std::optional<Frame>>>& burst);

}  // namespace mr::eval
