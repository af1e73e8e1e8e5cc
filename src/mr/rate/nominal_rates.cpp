#include "mr/rate/nominal_rates.h"

#include <algorithm>
#include <cmath>

#include "mr/core/assert.h"
#include "mr/rate/swept_surface.h"

namespace mr::rate {

std::size_t NominalRates::size() { return kErrors + kTextures; }

NominalRates NominalRates::train(std::span<const Sweep> sweeps) {
  MR_ASSERT(!sweeps.empty());
  std::vector<double> mean(size(), 0);
  for (const Sweep& sweep : sweeps) {
    const GridValues grid = grid_values(sweep);
    const double share = 1.0 / static_cast<double>(sweeps.size());
    for (std::size_t i = 0; i < kErrors; ++i) mean[i] += share * std::log(grid.geometry_mbps[i]);
    for (std::size_t i = 0; i < kTextures; ++i)
      mean[kErrors + i] += share * std::log(grid.texture_mbps[i]);
  }
  return NominalRates(std::move(mean));
}

std::vector<double> NominalRates::usual_log_mbps(const Observation::Produced& produced) const {
  GridValues grid;
  for (std::size_t i = 0; i < log_mbps_.size(); ++i)
    (i < kErrors ? grid.geometry_mbps : grid.texture_mbps).push_back(std::exp(log_mbps_[i]));
  grid.ssim.assign(kErrors * kTextures, 0);  // of no interest
  const RateSurface nominal(grid);
  const Setting& s = produced.setting;
  const auto log_of = [](double mbps) { return std::log(positive_mbps(mbps)); };
  return {log_of(produced.geometry_mbps) +
              log_of(nominal.geometry_mbps(kUsualSetting.error_voxels)) -
              log_of(nominal.geometry_mbps(s.error_voxels)),
          log_of(produced.texture_mbps) +
              log_of(nominal.texture_mbps(kUsualSetting.scale, kUsualSetting.qp)) -
              log_of(nominal.texture_mbps(s.scale, s.qp))};
}

}  // namespace mr::rate
