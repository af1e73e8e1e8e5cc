#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/result.h"
#include "mr/node/calibration_check.h"
#include "mr/runtime/lockstep_scene.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// A capture as a client shows it.
struct ClientCapture {
  int capture = 0;
  DecodedScene scene;  ///< without pictures unless it is the last of a run
};

/// What a client showed at the end of a run.
struct ClientRun {
  std::vector<ClientCapture> last;         ///< oldest first; not empty
  std::vector<node::InputResidual> pairs;  ///< of the root's inputs; empty: a baseline

  const DecodedScene& shown() const { return last.back().scene; }
};

/// Runs the scene's pipeline in lockstep for so many captures and keeps the last `kept` that were
/// shown. Baselines have no memory beyond their video: they code the last `kept` captures only.
/// The scene must be prepared. Errors: those of runtime::LockstepScene and baseline::run_baseline.
Result<ClientRun> run_client(const Scene& scene, int captures, int kept,
                             const runtime::RunListener& listener,
                             const std::filesystem::path& rig_cache);

}  // namespace mr::eval
