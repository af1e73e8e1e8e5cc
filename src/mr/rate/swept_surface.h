#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <map>
#include <optional>
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
  std::vector<double> moving_ssim;    ///< the same, of the moving surface (Sweep::Quality)
  /// A lattice against the grid's: factor of the geometry's rate, differences of quality.
  struct Lattice {
    double rate = 1, ssim = 0, moving_ssim = 0;
  };
  std::array<Lattice, std::size(kLattices)> lattices = {};
};

/// The place of a lattice in kLattices.
std::size_t lattice_place(int bits);
/// Values whose `ssim` is a mean: with weight `moving_weight` (0..1) of that of what moves, and the
/// rest of that of the whole picture.
GridValues weighted(GridValues values, double moving_weight);

/// A rate above 0, also of a picture that does not change, which costs nothing: its logarithm is
/// taken.
inline double positive_mbps(double mbps) { return std::max(mbps, 1e-4); }

/// The values of a sweep at the grid's nodes; it must have measured all of them.
GridValues grid_values(const Sweep& sweep);
/// Whether a sweep has measured all nodes of the grid.
bool is_complete(const Sweep& sweep);

/// Rate and quality of every setting, between the nodes of the grid: monotone curves of the
/// logarithm of the rate, and of quality, over the quantiser and the logarithm of the error. Of the
/// values' `ssim`: see weighted().
class RateSurface {
 public:
  explicit RateSurface(const GridValues& values);

  double geometry_mbps(double error_voxels, int bits = kBits) const;
  double texture_mbps(double scale, int qp) const;
  /// Quality over the logarithm of the error, on the grid's lattice.
  MonotoneCurve ssim_over_log_error(double scale, int qp) const;
  /// What another lattice than the grid's adds to quality.
  double ssim_of_lattice(int bits) const { return lattices_[lattice_place(bits)].ssim; }
  RatePoint at(const Setting& setting) const;

 private:
  struct Scale {
    MonotoneCurve log_mbps;           ///< over QP
    std::vector<MonotoneCurve> ssim;  ///< [kErrorNodes_voxels] over QP
  };
  MonotoneCurve log_geometry_;  ///< over log error
  std::map<double, Scale> scales_;
  std::array<GridValues::Lattice, std::size(kLattices)> lattices_;
};

/// The settings among which rate control chooses, on a surface: every quantiser at each scale, from
/// decimation to decimation a step of a 1.4th, every lattice; `bits`: this one.
std::vector<RatePoint> candidate_points(const RateSurface& surface, std::optional<int> bits = {});

/// The setting of best quality within a rate; the one of lowest rate where none is. The points must
/// not be empty.
RatePoint best_within(std::span<const RatePoint> points, double mbps);

}  // namespace mr::rate
