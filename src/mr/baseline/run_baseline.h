#pragma once

#include <filesystem>

#include "mr/baseline/baseline.h"
#include "mr/node/pipeline.h"

namespace mr::baseline {

struct BaselineRun {
  node::RunReport report;
  DecodedScene last;
};

/// node::Pipeline's lockstep run for the scene's baseline: capture, code, decode, frame by frame.
/// The listener's `shown` is told every decoded frame; a capture that coding.frame_divider leaves
/// out costs nothing and shows what was there before. `first_frame`: sources start there.
Result<BaselineRun> run_baseline(const Scene& scene, int frames, int first_frame,
                                 const node::RunListener& listener,
                                 const std::filesystem::path& cache_folder);

}  // namespace mr::baseline
