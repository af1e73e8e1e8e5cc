#include "mr/rate/monotone_curve.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/core/assert.h"

namespace mr::rate {
namespace {

/// The slope at a point between two pieces (Fritsch and Butland 1984): a weighted harmonic mean,
/// 0 at an extremum.
double inner_slope(double width0, double width1, double rise0, double rise1) {
  if (rise0 * rise1 <= 0) return 0;
  const double w0 = 2 * width1 + width0, w1 = width1 + 2 * width0;
  return (w0 + w1) / (w0 / rise0 + w1 / rise1);
}

}  // namespace

MonotoneCurve::MonotoneCurve(std::vector<double> x, std::vector<double> y)
    : x_(std::move(x)), y_(std::move(y)), slope_(x_.size(), 0) {
  MR_ASSERT(!x_.empty() && x_.size() == y_.size());
  const std::size_t pieces = x_.size() - 1;
  if (pieces == 0) return;
  std::vector<double> width(pieces), rise(pieces);
  for (std::size_t i = 0; i < pieces; ++i) {
    width[i] = x_[i + 1] - x_[i];
    MR_ASSERT(width[i] > 0);
    rise[i] = (y_[i + 1] - y_[i]) / width[i];
  }
  slope_.front() = rise.front(), slope_.back() = rise.back();
  for (std::size_t i = 1; i < pieces; ++i)
    slope_[i] = inner_slope(width[i - 1], width[i], rise[i - 1], rise[i]);
}

double MonotoneCurve::at(double x) const {
  if (x_.size() == 1) return y_.front();
  if (x <= x_.front()) return y_.front() + slope_.front() * (x - x_.front());
  if (x >= x_.back()) return y_.back() + slope_.back() * (x - x_.back());
  const auto above = std::upper_bound(x_.begin(), x_.end(), x);
  const std::size_t i = static_cast<std::size_t>(above - x_.begin()) - 1;
  const double width = x_[i + 1] - x_[i], t = (x - x_[i]) / width, t2 = t * t, t3 = t2 * t;
  return (2 * t3 - 3 * t2 + 1) * y_[i] + (t3 - 2 * t2 + t) * width * slope_[i] +
         (3 * t2 - 2 * t3) * y_[i + 1] + (t3 - t2) * width * slope_[i + 1];
}

}  // namespace mr::rate
