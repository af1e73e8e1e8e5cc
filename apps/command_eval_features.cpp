#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "commands.h"
#include "mr/core/file.h"
#include "mr/core/parallel.h"
#include "mr/eval/plot.h"
#include "mr/node/capture.h"
#include "mr/node/sources.h"
#include "mr/rate/features.h"
#include "mr/synth/room.h"
#include "output.h"

namespace mr::apps {
namespace {

using rate::PictureFeatures;
using rate::SceneFeatures;

struct FeatureOptions {
  std::vector<std::filesystem::path> scenes;
  std::vector<std::string> set;
  int frames = 60, every = 1, threads = 0;
  std::filesystem::path csv, plot;
  bool json = false;
};

struct Feature {
  const char* key;    ///< in CSV and JSON
  const char* title;  ///< in the plot
  PictureFeatures SceneFeatures::*picture;
  double PictureFeatures::*value;

  double of(const SceneFeatures& features) const { return features.*picture.*value; }
};
constexpr Feature kFeatures[] = {
    {"color_spatial", "Colour, spatial", &SceneFeatures::color, &PictureFeatures::spatial},
    {"color_temporal", "Colour, temporal", &SceneFeatures::color, &PictureFeatures::temporal},
    {"depth_spatial", "Depth, spatial", &SceneFeatures::depth, &PictureFeatures::spatial},
    {"depth_temporal", "Depth, temporal", &SceneFeatures::depth, &PictureFeatures::temporal}};

struct FrameFeatures {
  std::uint64_t frame = 0;
  SceneFeatures features;  ///< mean over sensors
};

struct SceneRow {
  std::string id;
  std::vector<FrameFeatures> frames;

  double mean(const Feature& feature) const {
    double sum = 0;
    for (const FrameFeatures& frame : frames) sum += feature.of(frame.features);
    return sum / static_cast<double>(frames.size());
  }
};

bool has_color(const Scene& scene) {
  return std::any_of(scene.sensors.begin(), scene.sensors.end(),
                     [](const SensorConfig& sensor) { return sensor.color_camera.has_value(); });
}

// ------------------------------------------------------------------------------------ measuring

/// Of the sensors that delivered the last capture.
using Extractors = std::map<SensorId, rate::FeatureExtractor>;

/// The features of the next capture, of the sensors that delivered the one before it, too; nothing
/// at the end.
std::optional<std::vector<rate::SensorFeatures>> next_features(node::CaptureReader& reader,
                                                               Extractors& extractors) {
  const auto frames = reader.next(
      [](SensorId, const Error& error) { fmt::print(stderr, "dropped: {}\n", error.message); });
  if (!frames) return std::nullopt;
  Extractors delivered;
  std::vector<rate::SensorFeatures> out;
  for (const Frame& frame : *frames) {
    const auto before = extractors.find(frame.sensor);
    rate::FeatureExtractor& extractor = delivered[frame.sensor];
    if (before != extractors.end()) extractor = std::move(before->second);
    const SceneFeatures features = extractor.extract(frame);
    if (before != extractors.end()) out.push_back({!frame.color.empty(), features});
  }
  extractors = std::move(delivered);
  return out;
}

void show_frame(const std::string& scene, int done, int of) {
  if (!isatty(STDERR_FILENO)) return;
  fmt::print(stderr, "\r\x1b[K{}: frame {}/{}", scene, done + 1, of);
  std::fflush(stderr);
}

/// Frames 1, 1 + every, …: each has one before it.
std::vector<FrameFeatures> measure(const Scene& scene, const FeatureOptions& options) {
  node::CaptureReader reader(scene, synth::default_rig_cache());
  Extractors extractors;
  std::vector<FrameFeatures> rows;
  for (int i = 0; i < options.frames; ++i) {
    show_frame(scene.id, i, options.frames);
    if (i == 0 || options.every > 1) {
      if (i > 0) reader.skip(static_cast<std::uint64_t>(options.every) - 2);
      if (!next_features(reader, extractors)) break;
    }
    const auto sensors = next_features(reader, extractors);
    if (!sensors) break;
    if (!sensors->empty())
      rows.push_back(
          {static_cast<std::uint64_t>(i) * options.every + 1, rate::mean_features(*sensors)});
  }
  return rows;
}

Result<std::vector<SceneRow>> measure_all(std::vector<Scene> scenes,
                                          const FeatureOptions& options) {
  std::vector<SceneRow> rows;
  for (Scene& scene : scenes) {
    SceneRow row{scene.id, {}};
    Arena(options.threads > 0 ? options.threads : scene.threads).run([&] {
      row.frames = measure(scene, options);
    });
    if (isatty(STDERR_FILENO)) std::fputs("\r\x1b[K", stderr);
    if (row.frames.empty())
      return Error{Error::Cause::not_found,
                   scene.file.string() +
                       ": no sensor delivered two frames in a row; for stills say loop: true"};
    rows.push_back(std::move(row));
  }
  return rows;
}

// ------------------------------------------------------------------------------------ telling

std::string to_csv(const std::vector<SceneRow>& rows) {
  std::string csv = "scene,frame";
  for (const Feature& feature : kFeatures) csv += fmt::format(",{}", feature.key);
  csv += '\n';
  for (const SceneRow& row : rows)
    for (const FrameFeatures& frame : row.frames) {
      csv += fmt::format("{},{}", row.id, frame.frame);
      for (const Feature& feature : kFeatures)
        csv += fmt::format(",{:.4f}", feature.of(frame.features));
      csv += '\n';
    }
  return csv;
}

std::string to_json(const std::vector<SceneRow>& rows) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const SceneRow& row : rows) {
    nlohmann::ordered_json one{{"scene", row.id}, {"frames", row.frames.size()}};
    for (const Feature& feature : kFeatures) one["mean"][feature.key] = row.mean(feature);
    for (const FrameFeatures& frame : row.frames) {
      one["frame"].push_back(frame.frame);
      for (const Feature& feature : kFeatures)
        one[feature.key].push_back(feature.of(frame.features));
    }
    json.push_back(std::move(one));
  }
  return json.dump(2) + "\n";
}

std::string to_text(const std::vector<SceneRow>& rows) {
  std::string text = fmt::format("{:24} {:>6}", "mean DCT energy", "frames");
  for (const Feature& feature : kFeatures) text += fmt::format(" {:>16}", feature.title);
  text += '\n';
  for (const SceneRow& row : rows) {
    text += fmt::format("{:24} {:>6}", row.id, row.frames.size());
    for (const Feature& feature : kFeatures) text += fmt::format(" {:>16.1f}", row.mean(feature));
    text += '\n';
  }
  return text;
}

/// The paper's Fig. 9, a panel for each feature.
std::string to_svg(const std::vector<SceneRow>& rows) {
  std::vector<eval::Plot> panels;
  for (const Feature& feature : kFeatures) {
    eval::Plot plot;
    plot.title = feature.title, plot.x_label = "Frame", plot.y_label = "DCT energy";
    plot.width = 540, plot.height = 320;
    for (const SceneRow& row : rows) {
      eval::Series series{.name = row.id, .points = {}, .markers = false};
      for (const FrameFeatures& frame : row.frames)
        series.points.emplace_back(frame.frame, feature.of(frame.features));
      plot.series.push_back(std::move(series));
    }
    panels.push_back(std::move(plot));
  }
  return eval::draw_svg(panels, 2);
}

Status write(const FeatureOptions& options, const std::vector<SceneRow>& rows) {
  if (!options.csv.empty())
    if (const Status written = write_file(options.csv, to_csv(rows)); !written) return written;
  if (!options.plot.empty())
    if (const Status written = write_file(options.plot, to_svg(rows)); !written) return written;
  return {};
}

// ------------------------------------------------------------------------------------ the command

/// Loads all scenes; prints their problems; nothing if there is any problem.
std::optional<std::vector<Scene>> load_all(const FeatureOptions& options) {
  std::vector<Scene> scenes;
  for (const auto& file : options.scenes) {
    auto loaded = load_or_print_problems(file, options.set);
    if (!loaded) continue;
    auto scene = node::prepare_scene(*std::move(loaded));
    if (!scene)
      fail(scene.error().message);
    else if (!has_color(*scene))
      fail(file.string() + ": no sensor has colour, and features are of colour and depth");
    else
      scenes.push_back(*std::move(scene));
  }
  if (scenes.size() != options.scenes.size()) return std::nullopt;
  return scenes;
}

int features(const FeatureOptions& options) {
  for (const auto& file : {options.csv, options.plot})
    if (const Status ok = check({{}, file, {}}); !ok) return fail(ok.error().message);
  auto scenes = load_all(options);
  if (!scenes) return 1;
  const auto rows = measure_all(*std::move(scenes), options);
  if (!rows) return fail(rows.error().message);
  if (const Status written = write(options, *rows); !written) return fail(written.error().message);
  fmt::print("{}", options.json ? to_json(*rows) : to_text(*rows));
  return 0;
}

}  // namespace

void add_eval_features(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<FeatureOptions>();
  CLI::App* command = eval.add_subcommand(
      "features", "DCT energy of scenes over time, spatial and temporal (the paper's Fig. 9)");
  command->add_option("SCENE", options->scenes, "Scene files (YAML)")->required();
  add_set_option(*command, options->set);
  command
      ->add_option("--frames", options->frames,
                   "How many; from the second of the scene on, as each is compared to the one "
                   "before it")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command
      ->add_option("--every", options->every,
                   "Take only one frame in so many; still compared to the one just before it")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command->add_option(
      "--csv", options->csv,
      "Write scene,frame,color_spatial,color_temporal,depth_spatial,depth_temporal");
  command->add_option("--plot", options->plot,
                      "Write an SVG of four panels, one for each feature, a line for each scene");
  command->add_flag("--json", options->json, "Print means and frames as JSON");
  command->add_option("--threads", options->threads, "Threads; 0: as the scene says")
      ->check(CLI::Range(0, 1024));
  command->footer(
      "All figures are means over sensors, of luma 0..255 and depth in millimetres, noise "
      "included.\n"
      "Examples:\n"
      "  meshreduce eval features examples/eval/office-lively.yaml --frames 30\n"
      "  meshreduce eval features examples/eval/*.yaml --every 10 --frames 30 --csv energy.csv "
      "--plot energy.svg");
  command->callback([options, &exit_code] { exit_code = features(*options); });
}

}  // namespace mr::apps
