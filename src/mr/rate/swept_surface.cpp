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

const Sweep::Quality* find_quality(const Sweep& sweep, std::size_t geometry, std::size_t texture) {
  for (const Sweep::Quality& q : sweep.qualities)
    if (q.geometry == geometry && q.texture == texture) return &q;
  return nullptr;
}

/// What a lattice changes: mean over the pairs that were measured. Nothing where none was.
GridValues::Lattice find_lattice(const Sweep& sweep, int bits) {
  GridValues::Lattice out;
  double pairs = 0, log_rate = 0;
  for (const Sweep::Quality& q : sweep.qualities) {
    const Sweep::Geometry& geometry = sweep.geometries[q.geometry];
    if (geometry.bits != bits || bits == kBits) continue;
    const auto usual = find_geometry(sweep, geometry.error_voxels);
    const Sweep::Quality* of_usual = usual ? find_quality(sweep, *usual, q.texture) : nullptr;
    if (!of_usual) continue;
    log_rate += std::log(positive_mbps(sweep.geometry_mbps(geometry)) /
                         positive_mbps(sweep.geometry_mbps(sweep.geometries[*usual])));
    out.ssim += q.ssim - of_usual->ssim, out.moving_ssim += q.moving_ssim - of_usual->moving_ssim;
    ++pairs;
  }
  if (pairs > 0) out = {std::exp(log_rate / pairs), out.ssim / pairs, out.moving_ssim / pairs};
  return out;
}

std::optional<GridValues> find_values(const Sweep& sweep) {
  GridValues out;
  for (const double error : kErrorNodes_voxels) {
    const auto g = find_geometry(sweep, error);
    if (!g) return std::nullopt;
    out.geometry_mbps.push_back(positive_mbps(sweep.geometry_mbps(sweep.geometries[*g])));
    for (const TextureNode& node : kTextureNodes) {
      const auto t = find_texture(sweep, node);
      const Sweep::Quality* quality = t ? find_quality(sweep, *g, *t) : nullptr;
      if (!quality) return std::nullopt;
      out.ssim.push_back(quality->ssim), out.moving_ssim.push_back(quality->moving_ssim);
    }
  }
  for (const TextureNode& node : kTextureNodes)
    out.texture_mbps.push_back(
        positive_mbps(sweep.texture_mbps(sweep.textures[*find_texture(sweep, node)])));
  for (std::size_t l = 0; l < out.lattices.size(); ++l)
    out.lattices[l] = find_lattice(sweep, kLattices[l]);
  return out;
}

}  // namespace

GridValues grid_values(const Sweep& sweep) {
  auto values = find_values(sweep);
  MR_ASSERT(values);
  return *std::move(values);
}

bool is_complete(const Sweep& sweep) { return find_values(sweep).has_value(); }

std::size_t lattice_place(int bits) {
  const auto found = std::ranges::find(kLattices, bits);
  MR_ASSERT(found != std::end(kLattices));
  return static_cast<std::size_t>(found - std::begin(kLattices));
}

GridValues weighted(GridValues values, double moving_weight) {
  MR_ASSERT(values.moving_ssim.size() == values.ssim.size());
  const auto mixed = [&](double whole, double moving) {
    return (1 - moving_weight) * whole + moving_weight * moving;
  };
  std::ranges::transform(values.ssim, values.moving_ssim, values.ssim.begin(), mixed);
  for (auto& lattice : values.lattices) lattice.ssim = mixed(lattice.ssim, lattice.moving_ssim);
  return values;
}

RateSurface::RateSurface(const GridValues& values) : lattices_(values.lattices) {
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

double RateSurface::geometry_mbps(double error_voxels, int bits) const {
  return lattices_[lattice_place(bits)].rate * std::exp(log_geometry_.at(std::log(error_voxels)));
}

double RateSurface::texture_mbps(double scale, int qp) const {
  return std::exp(scales_.at(scale).log_mbps.at(qp));
}

MonotoneCurve RateSurface::ssim_over_log_error(double scale, int qp) const {
  std::vector<double> log_error, ssim;
  for (std::size_t e = 0; e < kErrors; ++e) {
    log_error.push_back(std::log(kErrorNodes_voxels[e]));
    ssim.push_back(scales_.at(scale).ssim[e].at(qp));
  }
  return {std::move(log_error), std::move(ssim)};
}

RatePoint RateSurface::at(const Setting& setting) const {
  return {
      setting,
      geometry_mbps(setting.error_voxels, setting.bits) + texture_mbps(setting.scale, setting.qp),
      ssim_over_log_error(setting.scale, setting.qp).at(std::log(setting.error_voxels)) +
          ssim_of_lattice(setting.bits)};
}

namespace {

constexpr double kErrorSteps_voxels[] = {0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 6.0};

/// Every quantiser at each scale, from its first node to its last.
const std::vector<TextureNode>& texture_steps() {
  static const std::vector<TextureNode> all = [] {
    std::vector<TextureNode> out;
    for (const TextureNode& node : kTextureNodes) {
      const bool is_first = out.empty() || out.back().scale != node.scale;
      for (int qp = is_first ? node.qp : out.back().qp + 1; qp <= node.qp; ++qp)
        out.push_back({node.scale, qp});
    }
    return out;
  }();
  return all;
}

}  // namespace

std::vector<RatePoint> candidate_points(const RateSurface& surface, std::optional<int> bits) {
  std::vector<RatePoint> out;
  for (const auto& [scale, qp] : texture_steps()) {
    const double texture_mbps = surface.texture_mbps(scale, qp);
    const MonotoneCurve ssim = surface.ssim_over_log_error(scale, qp);
    for (const double error : kErrorSteps_voxels) {
      const double on_grid = ssim.at(std::log(error));
      for (const int lattice : kLattices)
        if (!bits || lattice == *bits)
          out.push_back({{error, lattice, scale, qp},
                         surface.geometry_mbps(error, lattice) + texture_mbps,
                         on_grid + surface.ssim_of_lattice(lattice)});
    }
  }
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
