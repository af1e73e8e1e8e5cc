#pragma once

#include <algorithm>
#include <map>
#include <span>
#include <vector>

#include "mr/rate/grid.h"
#include "mr/rate/monotone_curve.h"
#include "mr/rate/rate_distortion.h"
#include "mr/rate/setting.h"
#include "mr/rate/sweep.h"

namespace mr::rate {

/// Rate and quality at the nodes of the grid: of a sweep, or as a model predicts them.
struct GridValues {
  std::vector<double> geometry_mbps;  ///< [kErrorNodes_voxels], > 0
  std::vector<double> texture_mbps;   ///< [kTextureNodes], > 0
  std::vector<double> ssim;           ///< [kErrorNodes_voxels * kTextureNodes]
};

/// A rate above 0, also of a picture that does not change, which costs nothing: its logarithm is
/// taken.
inline double positive_mbps(double mbps) { return std::max(mbps, 1e-4); }

/// The values of a sweep at the grid's nodes; it must have measured all of them.
GridValues grid_values(const Sweep& sweep);
/// Whether a sweep has measured all nodes of the grid.
bool is_complete(const Sweep& sweep);

/// Rate and quality of every setting, between the nodes of the grid: monotone curves of the
/// logarithm of the rate, and of quality, over the quantiser and the logarithm of the error.
class RateSurface {
 public:
  explicit RateSurface(const GridValues& values);

  double geometry_mbps(double error_voxels) const;
  double texture_mbps(double scale, int qp) const;
  double ssim(const Setting& setting) const;
  RatePoint at(const Setting& setting) const;

 private:
  struct Scale {
    MonotoneCurve log_mbps;           ///< over QP
    std::vector<MonotoneCurve> ssim;  ///< [kErrorNodes_voxels] over QP
  };
  MonotoneCurve log_geometry_;  ///< over log error
  std::map<double, Scale> scales_;
};

/// The settings among which rate control chooses: every quantiser at each scale, from decimation to
/// decimation a step of a 1.4th; with the grid's lattice.
const std::vector<Setting>& candidates();

/// All candidates on a surface.
std::vector<RatePoint> candidate_points(const RateSurface& surface);

/// The setting of best quality within a rate; the one of lowest rate where none is. The points must
/// not be empty.
RatePoint best_within(std::span<const RatePoint> points, double mbps);

}  // namespace mr::rate
