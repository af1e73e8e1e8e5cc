#pragma once

#include <filesystem>

#include "mr/baseline/baseline.h"
#include "mr/runtime/lockstep_scene.h"

namespace mr::baseline {

struct BaselineRun {
  runtime::RunReport report;
  DecodedScene last;
};

/// runtime::LockstepScene's lockstep run for the scene's baseline: capture, code, decode, frame by
/// frame. The listener's `sent` and `shown` are called for every frame, counted from `first_frame`,
/// where the sources start; a capture that coding.frame_divider leaves out costs 0 bytes and shows
/// what was there before. Bytes of the report are means over all captures; latencies are of those
/// sent.
Result<BaselineRun> run_baseline(const Scene& scene, int frames, int first_frame,
                                 const runtime::RunListener& listener,
                                 const std::filesystem::path& cache_folder);

}  // namespace mr::baseline
