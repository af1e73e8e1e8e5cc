#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "mr/core/result.h"
#include "mr/eval/quality.h"
#include "mr/rate/sweep.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// The settings of a sweep: a coarse grid over decimation and texture, the lattice's steps at one
/// decimation, then a bisection along the Pareto front. At most kMostSettings pairs of geometry and
/// texture.
inline constexpr int kMostSettings = 60;

/// Measures rate and distortion at one of a trial's moments (paper 4.2, Fig. 8a), in the steady
/// state. The scene is captured and learnt once; each geometry setting replays the moment's burst
/// from the learnt state, each texture setting encodes the same drawn tiles. `views`: at most so
/// many viewpoints.
Result<rate::Sweep> sweep_moment(const Trial& trial, std::size_t moment, std::size_t views,
                                 const QualityConfig& config);

/// The features of the moment alone.
Result<std::vector<rate::Feature>> features_at(const Trial& trial, std::size_t moment,
                                               const QualityConfig& config);

}  // namespace mr::eval
