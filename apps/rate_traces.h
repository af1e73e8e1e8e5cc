#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "mr/rate/simulation.h"

/// Traces of changing bandwidth, in virtual time, for `eval rate`.
namespace mr::apps {

/// A trace for one scene.
struct TraceRun {
  std::string scene, trace;
  rate::SimulationResult result;
};

/// Our model, trained on the other scenes, follows every trace for a minute in the steady state of
/// each scene. The scene starts, a door opens after half a minute, and key frames come at
/// intervals.
std::vector<TraceRun> run_traces(std::span<const rate::Sweep> sweeps);

nlohmann::ordered_json to_json(const std::vector<TraceRun>& runs);
std::string to_text(const std::vector<TraceRun>& runs);
/// Steps and Wi-Fi of one scene: target and rate, second by second.
std::string draw_traces(const std::vector<TraceRun>& runs, const std::string& scene);

}  // namespace mr::apps
