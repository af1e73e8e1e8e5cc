#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "eval_options.h"
#include "mr/core/result.h"
#include "mr/rate/sweep.h"

/// The stored sweeps of `eval rd`, as other commands read them.
namespace mr::apps {

inline constexpr const char* kSweepFolder = "examples/eval/rate";

/// The sweeps of a file. Errors name it.
Result<rate::SweepFile> read_sweeps(const std::filesystem::path& file);

/// All sweeps of a folder's JSON files, by name of the file. Errors: not_found: it holds none;
/// invalid: a sweep lacks settings that the models need.
Result<std::vector<rate::Sweep>> read_all_sweeps(const std::filesystem::path& folder);

struct SweepOptions : EvalOptions {
  SweepOptions() { moments = 2; }
  std::filesystem::path folder = kSweepFolder;  ///< of the results, one NAME.json for each scene
  std::size_t views = 16;
  bool again = false;  ///< measure what is stored, too
};

/// The options of eval except --json, and --views.
void add_sweep_options(CLI::App& command, SweepOptions& options);

/// The sweeps of these scenes: in the steady state where a scene has one, and with everything sent
/// anew. Measures moments that are not stored, or of another scene file, and stores each as it is
/// done. Shows progress.
Result<std::vector<rate::Sweep>> measure_sweeps(const std::vector<std::filesystem::path>& scenes,
                                                const SweepOptions& options);

}  // namespace mr::apps
