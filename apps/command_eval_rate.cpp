#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <initializer_list>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "commands.h"
#include "eval_options.h"
#include "mr/eval/plot.h"
#include "mr/rate/evaluation.h"
#include "mr/rate/hull_targets.h"
#include "mr/rate/models.h"
#include "output.h"
#include "rate_sweeps.h"
#include "rate_traces.h"

namespace mr::apps {
namespace {

using Json = nlohmann::ordered_json;
using Predictions = std::vector<rate::Prediction>;

constexpr int kTargets = 12;
constexpr int kChoices = 4;  // until ours has seen what its own settings cost

struct RateOptions {
  std::filesystem::path sweeps = kSweepFolder, plot, traces, csv;
  std::string scene = "office-lively";
  bool json = false;
};

struct Contender {
  std::string name;
  rate::Trainer train;
  rate::Corrections corrections;
};

template <typename M>
std::unique_ptr<rate::Model> trained(std::span<const rate::Sweep> sweeps) {
  return std::make_unique<M>(M::train(sweeps));
}

/// The paper's two models choose once, ours goes on by what was produced. Live, it looks at what
/// moves, too.
std::vector<Contender> contenders() {
  return {{"classifier", trained<rate::Classifier>, {1, true}},
          {"lookup", trained<rate::LookupTable>, {1, true}},
          {"ours", trained<rate::CurvePredictor>, {kChoices, true}},
          {"ours, live",
           trained<rate::CurvePredictor>,
           {kChoices, true, rate::RateConfig{}.moving_weight}},
          {"ours, first choice", trained<rate::CurvePredictor>, {1, true}},
          {"ours, features alone", trained<rate::CurvePredictor>, {1, false}}};
}

/// A part of the evaluation: which sweeps, and their targets.
struct Part {
  std::string key, title;
  bool layers;
  rate::Targets targets;
};

std::vector<double> own_range(const std::vector<rate::RatePoint>& hull, double) {
  return rate::targets_of(hull, kTargets);
}
std::vector<double> papers_range(const std::vector<rate::RatePoint>&, double) {
  return {10, 20, 30, 40, 50, 60, 70, 80, 90, 100};
}
rate::Targets share_of_usual(double share) {
  return [share](const std::vector<rate::RatePoint>&, double usual_mbps) {
    return std::vector{share * usual_mbps};
  };
}

std::vector<Part> parts() {
  return {{"steady", "steady state, each scene's own range", true, own_range},
          {"half", "steady state, half of what the usual setting needs", true, share_of_usual(0.5)},
          {"quarter", "steady state, a quarter of that", true, share_of_usual(0.25)},
          {"without_layers", "everything sent anew, each scene's own range", false, own_range},
          {"paper", "everything sent anew, 10 to 100 Mbit/s", false, papers_range}};
}

struct Outcome {
  Part part;
  std::vector<std::pair<std::string, Predictions>> models;
};

std::vector<Outcome> evaluate(const std::vector<rate::Sweep>& sweeps) {
  std::vector<Outcome> out;
  for (const Part& part : parts()) {
    std::vector<rate::Sweep> of_part;
    std::ranges::copy_if(sweeps, std::back_inserter(of_part),
                         [&](const rate::Sweep& s) { return s.layers == part.layers; });
    const auto is_first = [&](const rate::Sweep& s) { return s.scene == of_part.front().scene; };
    if (of_part.empty() || std::ranges::all_of(of_part, is_first)) continue;
    Outcome& outcome = out.emplace_back(Outcome{part, {}});
    for (const Contender& c : contenders())
      outcome.models.emplace_back(
          c.name, rate::leave_one_out(of_part, c.train, part.targets, c.corrections));
  }
  return out;
}

double five_places(double v) { return std::round(v * 1e5) / 1e5; }

Json rounded(std::initializer_list<std::pair<const char*, double>> figures) {
  Json out = Json::object();
  for (const auto& [name, value] : figures) out[name] = five_places(value);
  return out;
}

Json models_of(const Outcome& outcome) {
  Json out = Json::object();
  for (const auto& [name, predictions] : outcome.models) {
    const rate::GapStatistics s = rate::statistics(predictions);
    out[name] = rounded({{"mean_gap", s.mean},
                         {"p95_gap", s.p95},
                         {"max_gap", s.max},
                         {"over_target", s.over},
                         {"rate_error", s.rate_error},
                         {"mean_loss", s.mean_loss},
                         {"max_loss", s.most_loss},
                         {"mean_moving_loss", s.mean_moving_loss}});
  }
  return out;
}

const Predictions& ours(const Outcome& outcome) {
  return std::ranges::find(outcome.models, "ours", [](const auto& m) { return m.first; })->second;
}

/// The slowest choice of any model.
double decision_ms(const std::vector<Outcome>& outcomes) {
  double out = 0;
  for (const Outcome& outcome : outcomes)
    for (const auto& [name, predictions] : outcome.models)
      for (const rate::Prediction& p : predictions) out = std::max(out, p.decision_ms);
  return out;
}

/// The first part's figures, and each part's under its key.
std::string to_json(const std::vector<Outcome>& outcomes, const rate::InterpolationError& between,
                    const rate::RoomError& room, const std::vector<TraceRun>& traces) {
  Json out{{"models", models_of(outcomes.front())},
           {"rate_error", five_places(rate::statistics(ours(outcomes.front())).rate_error)},
           {"decision_ms", five_places(decision_ms(outcomes))}};
  for (const Outcome& outcome : outcomes)
    out["parts"][outcome.part.key] = {{"predictions", outcome.models.front().second.size()},
                                      {"models", models_of(outcome)}};
  out["interpolation"] = rounded({{"mean_rate", between.mean_rate},
                                  {"max_rate", between.most_rate},
                                  {"mean_ssim", between.mean_ssim},
                                  {"max_ssim", between.most_ssim}});
  out["interpolation"]["points"] = between.points;
  out["room"] = rounded({{"plate_bytes", room.plate_bytes},
                         {"plate_loss", room.plate_loss},
                         {"still_bytes", room.still_bytes},
                         {"still_loss", room.still_loss}});
  out["room"]["scenes"] = room.scenes;
  out["traces"] = to_json(traces);
  return out.dump(2) + "\n";
}

std::string to_text(const std::vector<Outcome>& outcomes) {
  std::string out;
  for (const Outcome& outcome : outcomes) {
    out += fmt::format("{}: {} predictions for scenes not trained on\n", outcome.part.title,
                       outcome.models.front().second.size());
    for (const auto& [name, predictions] : outcome.models) {
      const rate::GapStatistics s = rate::statistics(predictions);
      out += fmt::format(
          "  {:<21} gap to the hull {:.4f} mean, {:.4f} 95th percentile, {:.4f} most; over the "
          "target {:.0f} %; loss {:.4f} mean, {:.4f} most, of what moves {:.4f} mean\n",
          name, s.mean, s.p95, s.max, 100 * s.over, s.mean_loss, s.most_loss, s.mean_moving_loss);
    }
  }
  return out + fmt::format("slowest choice {:.2f} ms\n", decision_ms(outcomes));
}

/// The distribution of the gaps (paper, Fig. 16), one panel for each part.
std::string draw(const std::vector<Outcome>& outcomes) {
  std::vector<eval::Plot> panels;
  for (const Outcome& outcome : outcomes) {
    eval::Plot& plot = panels.emplace_back();
    plot.title = outcome.part.title;
    plot.x_label = "gap to the Pareto hull (SSIM)", plot.y_label = "share of predictions";
    plot.width = 520, plot.height = 340;
    for (const auto& [name, predictions] : outcome.models) {
      std::vector<double> gaps;
      for (const rate::Prediction& p : predictions) gaps.push_back(p.gap);
      std::ranges::sort(gaps);
      eval::Series series{name, {}, true, false};
      for (std::size_t i = 0; i < gaps.size(); ++i)
        series.points.emplace_back(gaps[i], static_cast<double>(i + 1) / gaps.size());
      plot.series.push_back(std::move(series));
    }
  }
  return eval::draw_svg(panels, 2);
}

std::string to_csv(const std::vector<Outcome>& outcomes) {
  std::string out = "part,model,scene,target_mbps,mbps,ssim,gap\n";
  for (const Outcome& outcome : outcomes)
    for (const auto& [name, predictions] : outcome.models)
      for (const rate::Prediction& p : predictions)
        out += fmt::format("{},\"{}\",{},{:.4f},{:.4f},{:.5f},{:.5f}\n", outcome.part.key, name,
                           p.scene, p.target_mbps, p.got.mbps, p.got.ssim, p.gap);
  return out;
}

int run_rate(const RateOptions& options) {
  for (const auto& file : {options.csv, options.plot, options.traces})
    if (const Status ok = check({{}, file, {}}); !ok) return fail(ok.error().message);
  const auto sweeps = read_all_sweeps(options.sweeps);
  if (!sweeps) return fail(sweeps.error().message);
  const std::vector<Outcome> outcomes = evaluate(*sweeps);
  if (outcomes.empty())
    return fail(
        "leaving one scene out needs sweeps of two; measure more with 'meshreduce eval rd'");
  const std::vector<TraceRun> traces = run_traces(*sweeps);
  const rate::InterpolationError between = rate::interpolation_error(*sweeps);
  const rate::RoomError room = rate::room_error(*sweeps);
  if (!options.traces.empty() &&
      std::ranges::find(traces, options.scene, &TraceRun::scene) == traces.end())
    return fail("no sweep in the steady state is of scene '" + options.scene + "'");
  if (const Status ok = write_all({{options.csv, to_csv(outcomes)},
                                   {options.plot, draw(outcomes)},
                                   {options.traces, draw_traces(traces, options.scene)}});
      !ok)
    return fail(ok.error().message);
  std::string checked = fmt::format(
      "between the settings of the grid, {} measured ones: rate off by {:.1f} % mean, {:.1f} % "
      "most, SSIM by {:.4f} and {:.4f}\n",
      between.points, 100 * between.mean_rate, 100 * between.most_rate, between.mean_ssim,
      between.most_ssim);
  checked += fmt::format(
      "the room, by features alone: bytes of plates off by {:.0f} %, of still surface by {:.0f} %, "
      "SSIM that is lost with coarser ones by {:.4f} and {:.4f}\n",
      100 * room.plate_bytes, 100 * room.still_bytes, room.plate_loss, room.still_loss);
  fmt::print("{}", options.json ? to_json(outcomes, between, room, traces)
                                : to_text(outcomes) + checked + to_text(traces));
  return 0;
}

}  // namespace

void add_eval_rate(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<RateOptions>();
  CLI::App* command = eval.add_subcommand(
      "rate", "Rate control: gap to the Pareto hull on scenes that were not trained on (Fig. 16)");
  command->add_option("--sweeps", options->sweeps, "Folder of the sweeps of 'eval rd'")
      ->capture_default_str();
  command->add_flag("--json", options->json, "Print the figures as JSON");
  command->add_option("--csv", options->csv, "Write every prediction as a line");
  command->add_option("--plot", options->plot, "Draw the distributions of the gaps (SVG)");
  command->add_option("--traces", options->traces,
                      "Draw how a scene's stream follows steps and a Wi-Fi-like link (SVG)");
  command->add_option("--scene", options->scene, "The scene of --traces")->capture_default_str();
  command->footer("Example:\n  meshreduce eval rate --plot gaps.svg --traces traces.svg");
  command->callback([options, &exit_code] { exit_code = run_rate(*options); });
}

}  // namespace mr::apps
