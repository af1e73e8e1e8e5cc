#pragma once

#include <vector>

#include "mr/scene/scene.h"

namespace mr::eval {

/// The captures that are measured: short bursts of consecutive captures, far apart (a "moment"
/// each). Quality is measured at the last capture of a burst, bitrate over the whole burst (see
/// docs/evaluation.md, Rate).
struct Moments {
  std::vector<int> first;  ///< [moments] first capture of each burst, counted from 0 at the sources
  int burst = 4;
  int warm_up = 0;  ///< captures that a stateful pipeline processes before the first burst
  int loop = 0;     ///< captures after which the sources start again; 0: they end

  int shown(std::size_t moment) const { return first[moment] + burst - 1; }

  /// Looping sources: a stateful pipeline processes the bursts this many captures (whole loops)
  /// later, so that the warm-up fits before the first one.
  int later() const;
  /// The first capture that a stateful pipeline processes.
  int fed_from() const { return first.front() + later() - warm_up; }
};

/// Captures that a stateful pipeline processes before it is measured (docs/evaluation.md, Steady
/// state).
inline constexpr int kWarmUpCaptures = 100;

/// Whether the output of a scene's pipeline depends on earlier captures, so that it needs a
/// warm-up.
bool is_stateful(const Scene& scene);

/// Spreads `moments` bursts evenly over the captures of the scene's sources; fewer bursts if there
/// are not enough captures (a still picture has one moment). In scenes with layers whose sources
/// end, the first burst comes after the warm-up or, in short ones, after half of the captures.
Moments spread_moments(const Scene& scene, int moments, int burst);

/// The bitrate of a stream in which one capture a second is sent in full (key frame, every chunk),
/// as for clients that join or have lost a frame, and the others are predicted from it.
class Rate {
 public:
  /// The bytes of one burst, capture by capture.
  void add_burst(const std::vector<double>& bytes);

  /// The same for predicted captures only.
  void add_steady(const std::vector<double>& bytes);

  /// Mean over the bursts, at `fps` captures a second.
  double mbps(double fps) const;

 private:
  double first_ = 0, following_ = 0;  // sums of bytes a capture
  int bursts_ = 0;
};

}  // namespace mr::eval
