#include "rate_traces.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "mr/eval/plot.h"
#include "mr/rate/curve_predictor.h"
#include "mr/rate/grid.h"
#include "mr/rate/swept_surface.h"

namespace mr::apps {
namespace {

constexpr double kSeconds = 60, kDoor_s = 30;

/// The range in which traces move: above the least rate, and below that of the best quality, so
/// that the scene could always use more; on the usual lattice.
std::pair<double, double> range_of(const rate::Sweep& sweep) {
  const rate::RateSurface surface(rate::grid_values(sweep));
  const auto hull = rate::convex_hull(rate::candidate_points(surface, rate::kBits));
  const double low = 1.4 * hull.front().mbps;
  return {low, std::max(0.8 * hull.back().mbps, 1.2 * low)};
}

/// What waits at the start: all of the still surface and the plates; behind a door, a third.
std::vector<rate::Burst> bursts_of(const rate::Sweep& sweep) {
  const double still = sweep.stills.empty() ? 0 : sweep.stills.front().bytes;
  double plates = 0;
  for (const rate::Sweep::Plates& of_qp : sweep.plates)
    if (of_qp.qp == rate::kBestPlateQp) plates = of_qp.key_bytes;
  return {{0, still, true, 1, plates}, {kDoor_s, still / 3, true, 1.5, plates / 3}};
}

/// What all scenes came to in one trace.
struct Summary {
  double target = 0, sent = 0;  ///< Mbit/s, summed over seconds
  double worst_second = 0;      ///< of the target
  double response_s = 0, largest_step = 0;
  double ssim = 0;  ///< as shown, less what the room lacks; summed over seconds
  int seconds = 0;
  int skipped = 0, changes = 0;
};

std::map<std::string, Summary> summaries(const std::vector<TraceRun>& runs) {
  std::map<std::string, Summary> out;
  for (const TraceRun& run : runs) {
    Summary& s = out[run.trace];
    const auto& seconds = run.result.seconds;
    for (std::size_t i = 0; i < seconds.size(); ++i) {
      s.target += seconds[i].target_mbps, s.sent += seconds[i].mbps;
      s.worst_second = std::max(s.worst_second, seconds[i].mbps / seconds[i].target_mbps);
      s.ssim += seconds[i].ssim - seconds[i].lacking, ++s.seconds;
      s.skipped += seconds[i].skipped, s.changes += seconds[i].changes;
      const bool same_target =
          i > 2 && std::abs(seconds[i].target_mbps / seconds[i - 1].target_mbps - 1) < 0.02;
      if (same_target)
        s.largest_step = std::max(s.largest_step, std::abs(seconds[i].ssim - seconds[i - 1].ssim));
    }
    s.response_s = std::max(s.response_s, run.result.response_s);
  }
  return out;
}

}  // namespace

std::vector<TraceRun> run_traces(std::span<const rate::Sweep> sweeps) {
  std::vector<TraceRun> out;
  std::string last;
  for (const rate::Sweep& sweep : sweeps) {
    if (!sweep.layers || sweep.scene == last) continue;  // one moment of each scene
    last = sweep.scene;
    std::vector<rate::Sweep> others;
    for (const rate::Sweep& other : sweeps)
      if (other.layers && other.scene != sweep.scene) others.push_back(other);
    if (others.empty()) continue;
    const auto model = std::make_shared<rate::CurvePredictor>(rate::CurvePredictor::train(others));
    const auto [low, high] = range_of(sweep);
    const std::vector<rate::Burst> bursts = bursts_of(sweep);
    for (const rate::Trace& trace : rate::traces(low, high, 7)) {
      rate::Controller controller(model, true, sweep.fps, trace.mbps(0));
      controller.set_coarsest_error(rate::coarsest_error_voxels(sweep.voxel_m));
      out.push_back(
          {sweep.scene, trace.name, rate::simulate(controller, sweep, trace, bursts, kSeconds, 1)});
    }
  }
  return out;
}

nlohmann::ordered_json to_json(const std::vector<TraceRun>& runs) {
  auto out = nlohmann::ordered_json::object();
  const auto rounded_to = [](double v) { return std::round(v * 1e4) / 1e4; };
  for (const auto& [name, s] : summaries(runs))
    out[name] = {{"of_target", rounded_to(s.sent / s.target)},
                 {"worst_second", rounded_to(s.worst_second)},
                 {"response_s", rounded_to(s.response_s)},
                 {"largest_ssim_step", rounded_to(s.largest_step)},
                 {"mean_ssim", rounded_to(s.ssim / s.seconds)},
                 {"skipped", s.skipped},
                 {"changes", s.changes}};
  return out;
}

std::string to_text(const std::vector<TraceRun>& runs) {
  std::string out = "changing bandwidth, a minute of every scene in virtual time\n";
  for (const auto& [name, s] : summaries(runs))
    out += fmt::format(
        "  {:<9} {:.1f} % of the target, worst second {:.1f} %, slowest answer to a step {:.0f} "
        "ms, captures left out {}, changes of the setting {}, largest step of SSIM {:.4f}\n",
        name, 100 * s.sent / s.target, 100 * s.worst_second, 1000 * s.response_s, s.skipped,
        s.changes, s.largest_step);
  return out;
}

std::string draw_traces(const std::vector<TraceRun>& runs, const std::string& scene) {
  std::vector<eval::Plot> panels;
  for (const TraceRun& run : runs) {
    if (run.scene != scene || (run.trace != "steps" && run.trace != "wifi")) continue;
    eval::Plot& plot = panels.emplace_back();
    plot.title = run.scene + ", " + (run.trace == "wifi" ? "a link like Wi-Fi" : "steps");
    plot.x_label = "seconds", plot.y_label = "Mbit/s";
    plot.width = 520, plot.height = 340;
    eval::Series target{"target", {}, true, false, true}, sent{"sent", {}, true, false},
        backlog{"of it still surface and plates", {}, true, false};
    for (std::size_t i = 0; i < run.result.seconds.size(); ++i) {
      const rate::SimulatedSecond& s = run.result.seconds[i];
      const auto at = static_cast<double>(i);
      target.points.emplace_back(at, s.target_mbps), sent.points.emplace_back(at, s.mbps);
      backlog.points.emplace_back(at, s.refinement_mbps);
    }
    plot.series = {std::move(target), std::move(sent), std::move(backlog)};
  }
  return panels.empty() ? std::string() : eval::draw_svg(panels, 2);
}

}  // namespace mr::apps
