#pragma once

#include <span>
#include <vector>

#include "mr/core/result.h"
#include "mr/rate/observation.h"
#include "mr/runtime/lockstep_scene.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// The features of a burst of captures that models of rate control are fed: those of the last one,
/// given the ones before, as the sensors' nodes find them; mean over the sensors that delivered.
/// `memory`: what the sensors know of the room; empty: nothing.
Result<std::vector<rate::Feature>> burst_features(
    const Scene& scene, std::span<const runtime::LockstepScene::Capture> burst,
    const runtime::LockstepScene::Memory& memory);

}  // namespace mr::eval
