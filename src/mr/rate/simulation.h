#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "mr/rate/controller.h"
#include "mr/rate/sweep.h"
#include "mr/rate/swept_surface.h"

namespace mr::rate {

/// A bandwidth over time, Mbit/s.
struct Trace {
  std::string name;
  std::function<double(double seconds)> mbps;
};
/// A constant, a step down and up, a ramp, and links like Wi-Fi and a cellular network, by seed:
/// between `low` and `high`.
std::vector<Trace> traces(double low_mbps, double high_mbps, std::uint64_t seed);

/// What a scene demands at once: at the start, and when a door opens.
struct Burst {
  double at_s = 0;
  double still_bytes = 0;  ///< of still surface that waits from then on
  bool key_frame = true;
  double busier = 1;       ///< factor on what the moving surface takes, for two seconds
  double plate_bytes = 0;  ///< of plates that wait from then on, behind the still surface
};

/// One second of a simulated stream.
struct SimulatedSecond {
  double target_mbps = 0, mbps = 0;
  double ssim = 0;               ///< of what is shown, with all of the room
  double lacking = 0;            ///< of that, while a backlog waits (loss_of())
  double refinement_mbps = 0;    ///< part of mbps
  int skipped = 0, changes = 0;  ///< captures left out; changes of the setting
};

struct SimulationResult {
  std::vector<SimulatedSecond> seconds;
  /// The longest time from a step of the target by over 30 % until three captures follow it.
  double response_s = 0;
};

/// Runs a controller in virtual time against a scene whose rates are those of a sweep, with noise
/// from capture to capture by seed. Key frames come with bursts and every `key_frame_every`
/// captures.
SimulationResult simulate(Controller& controller, const Sweep& sweep, const Trace& trace,
                          std::span<const Burst> bursts, double seconds, std::uint64_t seed,
                          int key_frame_every = 250);

}  // namespace mr::rate
