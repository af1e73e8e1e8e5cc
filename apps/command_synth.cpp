#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <tuple>

#include "commands.h"
#include "mr/core/parallel.h"
#include "mr/core/user_text.h"
#include "mr/synth/export_rig.h"
#include "output.h"

namespace mr::apps {
namespace {

struct SynthOptions {
  std::filesystem::path folder;
  RigConfig rig;
  std::string room, color = "1280x720", depth_mode = "nfov", noise = "kinect", format = "images";
  bool has_kind = false;  ///< --kind was given
  std::string kind = "room";
  std::vector<std::string> events;  ///< as in a scene file, with or without braces
  double fps = 30;
  int threads = 0;
  bool force = false;
};

const std::map<std::string, RigConfig::Kind> kKinds{{"room", RigConfig::Kind::room},
                                                    {"conference", RigConfig::Kind::conference},
                                                    {"office", RigConfig::Kind::office},
                                                    {"corridor", RigConfig::Kind::corridor},
                                                    {"hallway", RigConfig::Kind::hallway}};
const std::map<std::string, std::pair<int, int>> kDepthModes{{"nfov", {640, 576}},
                                                             {"nfov_binned", {320, 288}},
                                                             {"wfov_binned", {512, 512}},
                                                             {"wfov", {1024, 1024}}};

const std::map<std::string, synth::RigExport::Format> kFormats{
    {"images", synth::RigExport::Format::images},
    {"mkv", synth::RigExport::Format::mkv},
    {"tum", synth::RigExport::Format::tum}};

/// Adds events in the words of a scene file; they are read and checked as there.
Status read_events(const std::vector<std::string>& events, RigConfig& rig) {
  constexpr int kLinesBefore = 2;
  std::string scene = "scene: synth\nrig: " + synth::rig_yaml(rig);
  scene.back() = ',';
  scene += " events: [";
  for (const std::string& event : events)
    scene += "\n" + (event.starts_with("{") ? event : "{" + event + "}") + ",";
  const SceneResult read = parse_scene(scene + "]}\n", "synth");
  for (const SceneProblem& problem : read.problems) {
    const int number = problem.line - kLinesBefore - 1;
    const bool is_known = number >= 0 && number < static_cast<int>(events.size());
    return Error{
        Error::Cause::invalid,
        "--event" + (is_known ? " " + in_quotes(events[number]) : "") + ": " + problem.message};
  }
  rig.events = read.scene.rig->events;
  return {};
}

/// The words in the options → the rig; an Error names the first that cannot be used.
Result<RigConfig> rig_of(const SynthOptions& options) {
  RigConfig rig = options.rig;
  rig.kind = kKinds.at(options.kind);
  rig.room_m = usual_room_m(rig.kind);
  char rest = 0;
  if (!options.room.empty()) {
    const bool good = std::sscanf(options.room.c_str(), "%lfx%lfx%lf%c", &rig.room_m.x,
                                  &rig.room_m.y, &rig.room_m.z, &rest) == 3;
    for (const double side : {rig.room_m.x, rig.room_m.y, rig.room_m.z})
      if (!good || !(side >= 1 && side <= 50))
        return Error{Error::Cause::invalid,
                     "--room must be WIDTHxDEPTHxHEIGHT in metres, each 1 to 50, such as 6x5x3"};
  }
  if (std::sscanf(options.color.c_str(), "%dx%d%c", &rig.color_width, &rig.color_height, &rest) !=
          2 ||
      std::min(rig.color_width, rig.color_height) < 16 ||
      std::max(rig.color_width, rig.color_height) > 8192)
    return Error{Error::Cause::invalid, "--color must be WIDTHxHEIGHT, 16 to 8192 pixels a side"};
  std::tie(rig.depth_width, rig.depth_height) = kDepthModes.at(options.depth_mode);
  rig.noise = options.noise == "kinect";
  if (rig.sensors + rig.lidars == 0)
    return Error{Error::Cause::invalid, "a rig needs at least one of --sensors and --lidars"};
  if (!options.events.empty())
    if (const Status read = read_events(options.events, rig); !read) return read.error();
  return rig;
}

void show_progress(int done, int of) {
  if (!isatty(STDERR_FILENO)) return;
  constexpr int kWidth = 30;
  const int filled = kWidth * done / of;
  fmt::print(stderr, "\r\x1b[Kframe {}/{} [{:=<{}}>{: <{}}]", done + 1, of, "", filled, "",
             kWidth - filled);
  std::fflush(stderr);
}

/// Whether OUT was probably meant as the kind of the room: it names a kind and is no existing
/// folder.
bool is_kind_for_folder(const SynthOptions& options) {
  return !options.has_kind && kKinds.contains(options.folder.string()) &&
         !std::filesystem::exists(options.folder);
}

int synth(const SynthOptions& options) {
  if (is_kind_for_folder(options))
    return misuse(
        fmt::format("'{0}' is a kind of room, not a folder: meshreduce synth FOLDER "
                    "--kind {0} (or ./{0} for a folder of that name)",
                    options.folder.string()));
  const auto rig = rig_of(options);
  if (!rig) return misuse(rig.error().message);
  std::error_code failed;
  if (std::filesystem::exists(options.folder) && !std::filesystem::is_directory(options.folder))
    return fail(options.folder.string() + " is not a folder");
  if (!options.force && std::filesystem::exists(options.folder) &&
      !std::filesystem::is_empty(options.folder, failed))
    return fail(options.folder.string() + " is not empty; choose another folder or add --force");
  Status written;
  Arena(options.threads).run([&] {
    written = synth::export_rig(
        {*rig, options.fps, options.folder, show_progress, kFormats.at(options.format)});
  });
  if (isatty(STDERR_FILENO)) std::fputs("\r\x1b[K", stderr);
  if (!written) return fail(written.error().message);
  fmt::print("{}: {} sensors, {} frames\nNext: meshreduce run {} --frames {}\n",
             options.folder.string(), rig->sensors + rig->lidars, rig->frames,
             (options.folder / "scene.yaml").string(), std::min(rig->frames, 3));
  return 0;
}

void add_errors(CLI::App& command, RigConfig& rig) {
  command.add_option("--depth-noise", rig.depth_noise, "Times the usual depth noise")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  command.add_option("--depth-noise-px", rig.depth_noise_px, "correlated over so many pixels")
      ->check(CLI::Range(0.0, 16.0));
  command.add_option("--color-noise", rig.color_noise, "Deviation of colours, in levels of 255")
      ->check(CLI::Range(0.0, 64.0));
  command.add_option("--exposure-drift", rig.exposure_drift, "Exposure swings by ± stops")
      ->check(CLI::Range(0.0, 4.0));
  command.add_option("--exposure-period-s", rig.exposure_period_s, "so long a swing")
      ->check(CLI::Range(0.1, 36000.0))
      ->capture_default_str();
  command.add_option("--calib-error-mm", rig.calib_error_mm, "Stated poses are off by so much")
      ->check(CLI::Range(0.0, 1000.0));
  command.add_option("--calib-error-deg", rig.calib_error_deg, "and turned by so much")
      ->check(CLI::Range(0.0, 90.0));
  command.add_option("--exposure-spread", rig.exposure_spread, "Exposure is off by up to ± stops")
      ->check(CLI::Range(0.0, 4.0));
  command.add_option("--clock-offset-ms", rig.clock_offset_ms, "Clocks are off by up to ± ms")
      ->check(CLI::Range(0.0, 10000.0));
}

}  // namespace

void add_synth(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<SynthOptions>();
  RigConfig& rig = options->rig;
  rig.people = 2;
  rig.frames = 30;
  CLI::App* command = app.add_subcommand(
      "synth", "Write a synthetic rig: pictures or recordings, a scene file, and the true surface");
  command->add_option("OUT", options->folder, "Folder to write")->required();
  CLI::Option* kind = command->add_option("--kind", options->kind, "Kind of room")
                          ->check(CLI::IsMember(kKinds))
                          ->capture_default_str();
  command->add_option("--room", options->room, "Size in metres, such as 6x5x3; else by its kind");
  command->add_option("--seed", rig.seed, "Another seed is another room")->capture_default_str();
  command->add_option("--people", rig.people, "Who walk and gesture")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
  command->add_option("--sensors", rig.sensors, "Kinects; 0: LiDARs alone")
      ->check(CLI::Range(0, 400))
      ->capture_default_str();
  command->add_option("--lidars", rig.lidars, "360-degree LiDARs")
      ->check(CLI::Range(0, 16))
      ->capture_default_str();
  command->add_option("--lidar-beams", rig.lidar_beams, "Of each LiDAR")
      ->check(CLI::Range(8, 128))
      ->capture_default_str();
  command->add_option("--lidar-noise-mm", rig.lidar_noise_mm, "Deviation of its ranges")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command->add_option("--depth-mode", options->depth_mode, "Of the Kinects")
      ->check(CLI::IsMember(kDepthModes))
      ->capture_default_str();
  command->add_option("--color", options->color, "Size of colour pictures")->capture_default_str();
  command->add_option("--noise", options->noise, "Of depth")
      ->check(CLI::IsMember({"kinect", "none"}))
      ->capture_default_str();
  add_errors(*command, rig);
  command
      ->add_option("--event", options->events,
                   "What happens, as in a scene file: \"kind: sit, at: 90\"; once for each")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--detail", rig.detail, "Texture contrast and clutter, 0 to 1")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command->add_option("--frames", rig.frames, "How many")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_flag("--loop", rig.loop, "Motion repeats after the last frame");
  command->add_option("--fps", options->fps, "Frames a second")
      ->check(CLI::Range(1.0, 240.0))
      ->capture_default_str();
  command
      ->add_option("--format", options->format,
                   "Frames of Kinects as pictures, as recordings (mkv), or as TUM folders")
      ->check(CLI::IsMember(kFormats))
      ->capture_default_str();
  command->add_option("--threads", options->threads, "Threads; 0: all cores")
      ->check(CLI::Range(0, 1024));
  command->add_flag("--force", options->force, "Write into a folder that is not empty");
  command->footer(
      "Example:\n  meshreduce synth /tmp/office --kind office --sensors 6 --people 2 --frames 60");
  command->callback([options, kind, &exit_code] {
    options->has_kind = kind->count() > 0;
    exit_code = synth(*options);
  });
}

}  // namespace mr::apps
