#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/result.h"
#include "mr/runtime/lockstep_scene.h"
#include "mr/scene/scene.h"

/// Shared by the commands: loading a scene and reporting all its problems, running it with a
/// progress line, and writing results.
namespace mr::apps {

/// Prints "meshreduce: message" to stderr; returns exit code 1 (kFailed).
int fail(const std::string& message);
/// The same for incompatible options; returns exit code 2 (kMisused).
int misuse(const std::string& message);

/// Adds the repeatable option --set key=value, for load_or_print_problems().
void add_set_option(CLI::App& command, std::vector<std::string>& set);

/// Loads a scene with the values of --set. Prints every problem on stderr, one line each; nothing
/// if there is any problem.
std::optional<Scene> load_or_print_problems(const std::filesystem::path& file,
                                            const std::vector<std::string>& set);
std::optional<Scene> usable_or_print_problems(SceneResult result);

/// Prints the error of check(); returns the exit code: kMisused for an unsupported file extension.
int refused(const Error& error);

/// The output files of a run; an empty path: not written.
struct Outputs {
  std::filesystem::path model, report, snapshots;
};

/// Checks early for what would fail at the end: a missing folder, an unsupported file extension.
Status check(const Outputs& outputs);

struct RunOutcome {
  runtime::RunReport report;
  DecodedScene last;
};

/// A listener that prints "dropped: …" and "warning: …" lines on stderr.
runtime::RunListener printing_listener();

/// Runs a scene in lockstep with a progress line on a terminal and one line per dropped frame.
Result<RunOutcome> run_scene(const Scene& scene, int frames, int threads);

/// Writes the requested model, report and pictures.
Status write_outputs(const RunOutcome& outcome, const Scene& scene, const Outputs& outputs);

}  // namespace mr::apps
