#include "mr/rate/swept_surface.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "mr/core/assert.h"

namespace mr::rate {
namespace {

std::optional<std::size_t> find_geometry(const Sweep& sweep, double error_voxels) {
  for (std::size_t g = 0; g < sweep.geometries.size(); ++g)
    if (sweep.geometries[g].error_voxels == error_voxels && sweep.geometries[g].bits == kBits)
      return g;
  return std::nullopt;
}

std::optional<std::size_t> find_texture(const Sweep& sweep, const TextureNode& node) {
  for (std::size_t t = 0; t < sweep.textures.size(); ++t)
    if (sweep.textures[t].scale == node.scale && sweep.textures[t].qp == node.qp) return t;
  return std::nullopt;
}

std::optional<double> find_ssim(const Sweep& sweep, std::size_t geometry, std::size_t texture) {
  for (const Sweep::Quality& q : sweep.qualities)
    if (q.geometry == geometry && q.texture == texture) return q.ssim;
  return std::nullopt;
}

std::optional<GridValues> find_values(const Sweep& sweep) {
  GridValues out;
  for (const double error : kErrorNodes_voxels) {
    const auto g = find_geometry(sweep, error);
    if (!g) return std::nullopt;
    out.geometry_mbps.push_back(positive_mbps(sweep.geometry_mbps(sweep.geometries[*g])));
    for (const TextureNode& node : kTextureNodes) {
      const auto t = find_texture(sweep, node);
      const auto ssim = t ? find_ssim(sweep, *g, *t) : std::nullopt;
      if (!ssim) return std::nullopt;
      out.ssim.push_back(*ssim);
    }
  }
  for (const TextureNode& node : kTextureNodes)
    out.texture_mbps.push_back(
        positive_mbps(sweep.texture_mbps(sweep.textures[*find_texture(sweep, node)])));
  return out;
}

}  // namespace

GridValues grid_values(const Sweep& sweep) {
  auto values = find_values(sweep);
  MR_ASSERT(values);
  return *std::move(values);
}

bool is_complete(const Sweep& sweep) { return find_values(sweep).has_value(); }

RateSurface::RateSurface(const GridValues& values) {
  MR_ASSERT(values.geometry_mbps.size() == kErrors && values.texture_mbps.size() == kTextures &&
            values.ssim.size() == kErrors * kTextures);
  std::vector<double> log_error, log_mbps;
  for (std::size_t e = 0; e < kErrors; ++e) {
    log_error.push_back(std::log(kErrorNodes_voxels[e]));
    log_mbps.push_back(std::log(values.geometry_mbps[e]));
  }
  log_geometry_ = MonotoneCurve(log_error, log_mbps);
  for (const TextureNode& first : kTextureNodes) {
    if (scales_.contains(first.scale)) continue;
    std::vector<double> qp, log_texture;
    std::vector<std::vector<double>> ssim(kErrors);
    for (std::size_t t = 0; t < kTextures; ++t) {
      if (kTextureNodes[t].scale != first.scale) continue;
      qp.push_back(kTextureNodes[t].qp);
      log_texture.push_back(std::log(values.texture_mbps[t]));
      for (std::size_t e = 0; e < kErrors; ++e) ssim[e].push_back(values.ssim[e * kTextures + t]);
    }
    Scale& scale = scales_[first.scale];
    scale.log_mbps = MonotoneCurve(qp, log_texture);
    for (auto& of_error : ssim) scale.ssim.emplace_back(qp, std::move(of_error));
  }
}

double RateSurface::geometry_mbps(double error_voxels) const {
  return std::exp(log_geometry_.at(std::log(error_voxels)));
}

double RateSurface::texture_mbps(double scale, int qp) const {
  return std::exp(scales_.at(scale).log_mbps.at(qp));
}

double RateSurface::ssim(const Setting& setting) const {
  const Scale& scale = scales_.at(setting.scale);
  std::vector<double> log_error, of_error;
  for (std::size_t e = 0; e < kErrors; ++e) {
    log_error.push_back(std::log(kErrorNodes_voxels[e]));
    of_error.push_back(scale.ssim[e].at(setting.qp));
  }
  return MonotoneCurve(std::move(log_error), std::move(of_error))
      .at(std::log(setting.error_voxels));
}

RatePoint RateSurface::at(const Setting& setting) const {
  return {setting, geometry_mbps(setting.error_voxels) + texture_mbps(setting.scale, setting.qp),
          ssim(setting)};
}

const std::vector<Setting>& candidates() {
  static const std::vector<Setting> all = [] {
    std::vector<Setting> out;
    for (const double error : {0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 6.0})
      for (std::size_t t = 0; t < kTextures; ++t) {
        // From each node up to the next one of its scale.
        const bool is_last =
            t + 1 == kTextures || kTextureNodes[t + 1].scale != kTextureNodes[t].scale;
        const int end = is_last ? kTextureNodes[t].qp + 1 : kTextureNodes[t + 1].qp;
        for (int qp = kTextureNodes[t].qp; qp < end; ++qp)
          out.push_back({error, kBits, kTextureNodes[t].scale, qp});
      }
    return out;
  }();
  return all;
}

std::vector<RatePoint> candidate_points(const RateSurface& surface) {
  std::vector<RatePoint> out;
  for (const Setting& setting : candidates()) out.push_back(surface.at(setting));
  return out;
}

RatePoint best_within(std::span<const RatePoint> points, double mbps) {
  MR_ASSERT(!points.empty());
  const RatePoint* best = nullptr;
  for (const RatePoint& p : points)
    if (p.mbps <= mbps && (!best || p.ssim > best->ssim)) best = &p;
  return best ? *best : *std::ranges::min_element(points, {}, &RatePoint::mbps);
}

}  // namespace mr::rate
