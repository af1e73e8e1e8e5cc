#pragma once

#include <vector>

namespace mr::rate {

/// A curve through points that rises or falls where they do, without overshoot: piecewise cubic
/// Hermite (Fritsch and Butland 1984). Beyond its ends it goes on straight.
class MonotoneCurve {
 public:
  MonotoneCurve() = default;
  /// `x` ascends strictly; one value of y for each; at least one.
  MonotoneCurve(std::vector<double> x, std::vector<double> y);
  double at(double x) const;

 private:
  std::vector<double> x_, y_, slope_;
};

}  // namespace mr::rate
