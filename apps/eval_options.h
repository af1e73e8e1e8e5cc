#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "mr/cli/progress.h"
#include "mr/core/result.h"
#include "mr/eval/quality.h"
#include "mr/scene/scene.h"

/// Shared by the commands under `eval`.
namespace mr::apps {

struct EvalOptions {
  std::string reference;  ///< truth, monolithic; empty: the scene's best
  int moments = 3, burst = 4, threads = 0;
  bool json = false;
  std::vector<std::string> set;  ///< --set
};

/// --reference, --moments, --burst, --threads, --json and --set.
void add_eval_options(CLI::App& command, EvalOptions& options);

/// --threads, --json and --set alone.
void add_common_options(CLI::App& command, EvalOptions& options);

/// Whether a pipeline transmits the reference itself: it must not be ranked then.
bool is_reference(const std::string& pipeline, eval::ReferenceKind reference);

/// Validates a number: between `low` and `high`, not NaN.
CLI::Validator between(double low, double high);

/// The measurement's configuration from the options; `bar` must outlive it.
eval::QualityConfig quality_config(const EvalOptions& options, cli::ProgressBar& bar);

/// Runs `work` with the threads of the options, else of the scene.
void in_arena(const EvalOptions& options, const Scene& scene, const std::function<void()>& work);

/// Writes several files, or none of them. Files without a name are left out.
Status write_all(const std::vector<std::pair<std::filesystem::path, std::string>>& files);

/// Loads and prepares a scene for measuring; prints the problems of its file.
std::optional<Scene> load_for_eval(const std::filesystem::path& file,
                                   const std::vector<std::string>& set);

}  // namespace mr::apps
