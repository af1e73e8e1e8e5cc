#pragma once

#include <vector>

#include "mr/scene/scene.h"

namespace mr::eval {

/// Which captures are measured: short bursts that begin far apart. Quality is that of the last
/// capture of each; the rate is that of the whole burst, see Rate.
struct Moments {
  std::vector<int> first;  ///< capture numbers, from 0 at the sources
  int burst = 4;
  int warm_up = 0;  ///< captures that a pipeline with memory is fed before the first moment
  int loop = 0;     ///< captures after which the sources start again; 0: they end

  int shown(std::size_t moment) const { return first[moment] + burst - 1; }

  /// What a pipeline with memory reads are the same captures, so many later (whole loops) that the
  /// warm-up fits before the first moment.
  int later() const;
  /// The first capture that it reads.
  int fed_from() const { return first.front() + later() - warm_up; }
};

/// EVALUATION, Steady state.
inline constexpr int kWarmUpCaptures = 100;

/// Whether a scene's pipeline depends on the captures before: it must be warmed up.
bool is_stateful(const Scene& scene);

/// `moments` bursts spread evenly over what the scene's sources hold; fewer where they hold less (a
/// still picture is one moment). In scenes with layers whose sources end, the first lies after the
/// warm-up, or where they are short, after half of what they hold.
Moments spread_moments(const Scene& scene, int moments, int burst);

/// What a stream sends. A client joins, or loses a picture, now and then: we quote the rate of a
/// stream of which one capture a second is sent afresh (key frame, every chunk) and the others
/// follow from it.
class Rate {
 public:
  /// The bytes of one burst, capture by capture.
  void add_burst(const std::vector<double>& bytes);

  /// The same of captures that all follow from others: nothing is sent afresh.
  void add_steady(const std::vector<double>& bytes);

  /// Mean over the bursts, at `fps` captures a second.
  double mbps(double fps) const;

 private:
  double first_ = 0, following_ = 0;  // sums of bytes a capture
  int bursts_ = 0;
};

}  // namespace mr::eval
