#include "rate_sweeps.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <span>

#include "mr/core/file.h"
#include "mr/eval/rate_sweep.h"
#include "mr/eval/store.h"
#include "mr/rate/feature_space.h"
#include "mr/rate/swept_surface.h"

namespace mr::apps {
namespace {

/// A scene's stored sweeps, which are measured where they are missing or of another scene file.
class StoredSweeps {
 public:
  StoredSweeps(std::filesystem::path scene, const SweepOptions& options)
      : options_(options),
        scene_file_(std::move(scene)),
        file_(options.folder / scene_file_.filename().replace_extension(".json")) {}

  Result<rate::SweepFile> measure() {
    auto scene = load_for_eval(scene_file_, options_.set);
    if (!scene) return Error{Error::Cause::invalid, scene_file_.string() + " cannot be measured"};
    scene->coding.frame_divider = 1;
    if (const Status read = load(); !read) return read.error();
    std::optional<Status> done;
    in_arena(options_, *scene, [&] { done.emplace(measure(*scene)); });
    if (!*done) return done->error();
    return std::move(kept_);
  }

 private:
  Status load() {
    const auto text = read_file(scene_file_);
    if (!text) return text.error();
    eval::Fingerprint print;
    print.add(std::span(*text)).add(static_cast<double>(options_.views)).add(options_.burst);
    for (const std::string& set : options_.set) print.add(set);
    print.add(options_.reference);
    const auto views = std::filesystem::path(scene_file_).replace_extension(".views.json");
    if (const auto chosen = read_file(views)) print.add(std::span(*chosen));
    kept_.scene_hash = print.hex();
    if (options_.again) return {};
    auto stored = read_sweeps(file_);
    if (!stored) {
      const auto cause = stored.error().cause;  // missing or of another version: all is measured
      return cause == Error::Cause::not_found || cause == Error::Cause::unsupported
                 ? Status{}
                 : Status{stored.error()};
    }
    if (stored->scene_hash == kept_.scene_hash) kept_.sweeps = std::move(stored->sweeps);
    return {};
  }

  /// In the steady state where the scene has one, and with everything sent anew.
  Status measure(const Scene& scene) {
    std::vector<Scene> ways{scene};
    if (scene.still.layers) ways.emplace_back(scene).still.layers = false;
    cli::ProgressBar bar;
    for (const Scene& way : ways) {
      eval::QualityConfig config = quality_config(options_, bar);
      const auto trial = eval::Trial::prepare(way, config);
      if (!trial) return trial.error();
      for (const std::size_t moment : trial->all_moments()) {
        config.progress = [&](const std::string& step, std::size_t done, std::size_t of) {
          bar.show(fmt::format("{} {} {}", scene.id, moment + 1, step), done, of);
        };
        if (const Status done = measure(*trial, moment, config); !done) return done;
      }
    }
    return {};
  }

  Status measure(const eval::Trial& trial, std::size_t moment, const eval::QualityConfig& config) {
    const int capture = trial.moments().shown(moment);
    const bool layers = eval::is_stateful(trial.scene());
    for (rate::Sweep& known : kept_.sweeps)
      if (known.moment == capture && known.layers == layers)
        return refresh_features(trial, moment, config, known);
    auto sweep = eval::sweep_moment(trial, moment, options_.views, config);
    if (!sweep) return sweep.error();
    kept_.sweeps.push_back(*std::move(sweep));
    return write_file(file_, rate::to_json(kept_));
  }

  /// Measures the features again where the program knows others by now.
  Status refresh_features(const eval::Trial& trial, std::size_t moment,
                          const eval::QualityConfig& config, rate::Sweep& known) const {
    const auto has = [&](const char* name) {
      return std::ranges::find(known.features, name, &rate::Feature::name) != known.features.end();
    };
    if (std::ranges::all_of(rate::feature_names(), has)) return {};
    auto features = eval::features_at(trial, moment, config);
    if (!features) return features.error();
    known.features = *std::move(features);
    return write_file(file_, rate::to_json(kept_));
  }

  const SweepOptions& options_;
  std::filesystem::path scene_file_, file_;
  rate::SweepFile kept_;
};

}  // namespace

Result<rate::SweepFile> read_sweeps(const std::filesystem::path& file) {
  const auto bytes = read_file(file);
  if (!bytes) return bytes.error();
  auto sweeps =
      rate::sweeps_from_json({reinterpret_cast<const char*>(bytes->data()), bytes->size()});
  if (!sweeps) return Error{sweeps.error().cause, file.string() + ": " + sweeps.error().message};
  return sweeps;
}

Result<std::vector<rate::Sweep>> read_all_sweeps(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  std::error_code failed;
  for (const auto& entry : std::filesystem::directory_iterator(folder, failed))
    if (entry.path().extension() == ".json") files.push_back(entry.path());
  if (files.empty())
    return Error{Error::Cause::not_found,
                 folder.string() + " holds no sweeps: measure them with 'meshreduce eval rd'"};
  std::ranges::sort(files);
  std::vector<rate::Sweep> out;
  for (const auto& file : files) {
    auto sweeps = read_sweeps(file);
    if (!sweeps) return sweeps.error();
    for (const rate::Sweep& sweep : sweeps->sweeps)
      if (!rate::is_complete(sweep))
        return Error{Error::Cause::invalid,
                     file.string() +
                         ": a sweep lacks settings; measure it again with 'meshreduce "
                         "eval rd'"};
    std::ranges::move(sweeps->sweeps, std::back_inserter(out));
  }
  if (out.empty()) return Error{Error::Cause::not_found, folder.string() + " holds no sweeps"};
  return out;
}

void add_sweep_options(CLI::App& command, SweepOptions& options) {
  add_eval_options(command, options);
  command.remove_option(command.get_option("--json"));
  command.add_option("--views", options.views, "At most so many viewpoints")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
}

Result<std::vector<rate::Sweep>> measure_sweeps(const std::vector<std::filesystem::path>& scenes,
                                                const SweepOptions& options) {
  std::error_code error;
  std::filesystem::create_directories(options.folder, error);
  if (error)
    return Error{Error::Cause::io,
                 "cannot create " + options.folder.string() + ": " + error.message()};
  std::vector<rate::Sweep> out;
  for (const std::filesystem::path& scene : scenes) {
    auto sweeps = StoredSweeps(scene, options).measure();
    if (!sweeps) return sweeps.error();
    std::ranges::move(sweeps->sweeps, std::back_inserter(out));
  }
  return out;
}

}  // namespace mr::apps
