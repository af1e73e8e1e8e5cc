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

/// What the commands share: loading a scene with all its problems told, running it with a progress
/// line, and writing what came out.
namespace mr::apps {

/// Prints "meshreduce: message" to stderr; returns exit code 1 (kFailed).
int fail(const std::string& message);
/// The same for options that do not go together; returns exit code 2 (kMisused).
int misuse(const std::string& message);

/// --set key=value, as often as one likes; what load_or_tell takes.
void add_set_option(CLI::App& command, std::vector<std::string>& set);

/// Loads a scene, with what was set beside its file; tells every problem on stderr, one line each,
/// and gives nothing when there is any.
std::optional<Scene> load_or_tell(const std::filesystem::path& file,
                                  const std::vector<std::string>& set);
std::optional<Scene> usable_or_tell(SceneResult result);

/// Tells what check() found: an ending that nobody writes is a wrong command line.
int refused(const Error& error);

/// Where a run's results go; empty paths: nowhere.
struct Outputs {
  std::filesystem::path model, report, snapshots;
};

/// Finds what would fail only at the end: a folder that is not there, an ending nobody writes.
Status check(const Outputs& outputs);

struct RunOutcome {
  runtime::RunReport report;
  DecodedScene last;
};

/// Tells on stderr what is "dropped: …", and each "warning: …".
runtime::RunListener told_listener();

/// Runs a scene in lockstep with a progress line on a terminal and one line per dropped frame.
Result<RunOutcome> run_scene(const Scene& scene, int frames, int threads);

/// Writes the model, the report and the pictures that were asked for.
Status write_outputs(const RunOutcome& outcome, const Scene& scene, const Outputs& outputs);

}  // namespace mr::apps
