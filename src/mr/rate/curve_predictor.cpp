#include "mr/rate/curve_predictor.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <numeric>
#include <utility>

#include "mr/core/assert.h"
#include "mr/rate/cholesky.h"

namespace mr::rate {
namespace {

// A scene's values: rates of geometry, rates of texture; losses of quality and the best, of the
// whole picture and of what moves; of each lattice but the grid's, the logarithm of its rate
// against the grid's and the differences of quality; of the room, bytes and losses.
constexpr std::size_t kTextureAt = kErrors, kQualityAt = kTextureAt + kTextures,
                      kOfQuality = kErrors * kTextures + 1, kMovingAt = kQualityAt + kOfQuality,
                      kLatticesAt = kMovingAt + kOfQuality, kOfLattice = 3,
                      kRoomAt = kLatticesAt + (std::size(kLattices) - 1) * kOfLattice,
                      kPlates = std::size(kPlateNodes_qp), kStills = std::size(kStillNodes_voxels),
                      kValues = kRoomAt + 2 * kPlates + 1 + kStills;

constexpr double kLeastLoss = 5e-4;       // of SSIM: smaller ones are not told apart
constexpr double kShrinkage = 0.15;       // of the covariance towards its diagonal
constexpr double kFeatureNoise = 0.5;     // of their deviation over the scenes
constexpr double kFalls = 0.995;          // of a rate, at least, from node to coarser node
constexpr double kAgeing = 0.02;          // noise of a reading for each that came after it
constexpr double kRateNoise = 0.03;       // of what the encoders produce, from second to second
constexpr std::size_t kMostReadings = 6;  // of what was produced, the newest

/// Losses against the best, and the best.
void add_losses(const std::vector<double>& ssim, std::vector<double>& out) {
  const double best = *std::ranges::max_element(ssim);
  for (const double of_setting : ssim) out.push_back(std::log(best - of_setting + kLeastLoss));
  out.push_back(best);
}
std::vector<double> ssim_from(const double* losses) {
  std::vector<double> out;
  const double best = losses[kOfQuality - 1];
  for (std::size_t i = 0; i + 1 < kOfQuality; ++i)
    out.push_back(best - (std::exp(losses[i]) - kLeastLoss));
  return out;
}

void add_room(const RoomValues& room, std::vector<double>& out) {
  for (const double bytes : room.plate_bytes) out.push_back(std::log(bytes));
  for (const double loss : room.plate_loss) out.push_back(std::log(loss + kLeastLoss));
  out.push_back(std::log(room.still_bytes));
  for (const double loss : room.still_loss) out.push_back(std::log(loss + kLeastLoss));
}

/// Losses rise with a coarser node.
RoomValues room_of(const double* at) {
  RoomValues out;
  const auto losses = [&](std::size_t count) {
    std::vector<double> of_nodes(count);
    double most = 0;
    for (double& loss : of_nodes) loss = most = std::max(most, std::exp(*at++) - kLeastLoss);
    return of_nodes;
  };
  for (std::size_t i = 0; i < kPlates; ++i) out.plate_bytes.push_back(std::exp(*at++));
  out.plate_loss = losses(kPlates);
  out.still_bytes = std::exp(*at++);
  out.still_loss = losses(kStills);
  return out;
}

std::vector<double> values_of(const Sweep& sweep) {
  const GridValues grid = grid_values(sweep);
  std::vector<double> out;
  for (const double mbps : grid.geometry_mbps) out.push_back(std::log(mbps));
  for (const double mbps : grid.texture_mbps) out.push_back(std::log(mbps));
  add_losses(grid.ssim, out), add_losses(grid.moving_ssim, out);
  for (std::size_t l = 0; l < grid.lattices.size(); ++l)
    if (const auto& [rate, ssim, moving_ssim] = grid.lattices[l]; kLattices[l] != kBits)
      out.insert(out.end(), {std::log(rate), ssim, moving_ssim});
  add_room(room_values(sweep), out);
  return out;
}

GridValues grid_of(const std::vector<double>& values) {
  GridValues out;
  for (std::size_t i = 0; i < kErrors; ++i) out.geometry_mbps.push_back(std::exp(values[i]));
  for (std::size_t i = kTextureAt; i < kQualityAt; ++i)
    out.texture_mbps.push_back(std::exp(values[i]));
  out.ssim = ssim_from(&values[kQualityAt]), out.moving_ssim = ssim_from(&values[kMovingAt]);
  const double* at = &values[kLatticesAt];
  for (std::size_t l = 0; l < out.lattices.size(); ++l)
    if (kLattices[l] != kBits) out.lattices[l] = {std::exp(at[0]), at[1], at[2]}, at += kOfLattice;
  return out;
}

/// A linear reading of a scene's vector: weights of some of its places, and what was read.
struct Reading {
  std::vector<std::pair<std::size_t, double>> weights;
  double value = 0, noise = 0;  ///< standard deviation
};

/// Weights of the nodes beside a place on an ascending axis.
std::vector<std::pair<std::size_t, double>> between(std::span<const double> axis, std::size_t first,
                                                    double x) {
  const auto above = std::ranges::upper_bound(axis, x);
  const std::size_t i = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(
      above - axis.begin(), 1, static_cast<std::ptrdiff_t>(axis.size()) - 1));
  const double share = (x - axis[i - 1]) / (axis[i] - axis[i - 1]);
  return {{first + i - 1, 1 - share}, {first + i, share}};
}

std::vector<std::pair<std::size_t, double>> geometry_weights(const Setting& setting) {
  std::vector<double> axis;
  for (const double error : kErrorNodes_voxels) axis.push_back(std::log(error));
  auto out = between(axis, 0, std::log(setting.error_voxels));
  std::size_t at = kLatticesAt;
  for (const int bits : kLattices)
    if (bits != kBits) {
      if (bits == setting.bits) out.emplace_back(at, 1);
      at += kOfLattice;
    }
  return out;
}

std::vector<std::pair<std::size_t, double>> texture_weights(const Setting& setting) {
  std::vector<double> axis;
  std::size_t first = 0;
  for (std::size_t t = 0; t < kTextures; ++t)
    if (kTextureNodes[t].scale == setting.scale) {
      if (axis.empty()) first = t;
      axis.push_back(kTextureNodes[t].qp);
    }
  MR_ASSERT(axis.size() >= 2);
  return between(axis, kTextureAt + first, setting.qp);
}

/// The Gaussian of scenes' vectors (features, then values).
class Ensemble {
 public:
  explicit Ensemble(const std::vector<CurvePredictor::Member>& members) {
    for (const auto& member : members) {
      std::vector<double> row = member.features;
      row.insert(row.end(), member.values.begin(), member.values.end());
      rows_.push_back(std::move(row));
    }
    mean_.assign(rows_.front().size(), 0);
    for (const auto& row : rows_)
      for (std::size_t i = 0; i < mean_.size(); ++i)
        mean_[i] += row[i] / static_cast<double>(rows_.size());
    for (auto& row : rows_)
      for (std::size_t i = 0; i < mean_.size(); ++i) row[i] -= mean_[i];
    for (std::size_t i = 0; i < mean_.size(); ++i) {
      double sum = 0;
      for (const auto& row : rows_) sum += row[i] * row[i];
      variance_.push_back(sum / divisor() + 1e-6);
    }
  }

  /// The mean vector given the readings.
  std::vector<double> given(const std::vector<Reading>& readings) const {
    const std::size_t n = readings.size();
    std::vector<std::vector<double>> seen(n);  // [readings][members] deviations of the reading
    std::vector<double> off(n), covariance(n * n);
    for (std::size_t r = 0; r < n; ++r) {
      off[r] = readings[r].value - weighted(readings[r], mean_);
      for (const auto& row : rows_) seen[r].push_back(weighted(readings[r], row));
    }
    for (std::size_t a = 0; a < n; ++a)
      for (std::size_t b = 0; b < n; ++b)
        covariance[a * n + b] = (1 - kShrinkage) * product(seen[a], seen[b]) +
                                kShrinkage * own(readings[a], readings[b]) +
                                (a == b ? readings[a].noise * readings[a].noise : 0);
    const std::vector<double> gain = solve_spd(std::move(covariance), std::move(off));
    std::vector<double> out = mean_;
    for (std::size_t i = 0; i < out.size(); ++i) {
      std::vector<double> column;
      for (const auto& row : rows_) column.push_back(row[i]);
      for (std::size_t r = 0; r < n; ++r) {
        double own_part = 0;
        for (const auto& [at, weight] : readings[r].weights)
          if (at == i) own_part += weight * variance_[i];
        out[i] += gain[r] * ((1 - kShrinkage) * product(seen[r], column) + kShrinkage * own_part);
      }
    }
    return out;
  }

 private:
  double divisor() const { return std::max<double>(static_cast<double>(rows_.size()) - 1, 1); }
  static double weighted(const Reading& reading, const std::vector<double>& vector) {
    double sum = 0;
    for (const auto& [at, weight] : reading.weights) sum += weight * vector[at];
    return sum;
  }
  double product(const std::vector<double>& a, const std::vector<double>& b) const {
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0) / divisor();
  }
  /// Of the diagonal's part of the covariance.
  double own(const Reading& a, const Reading& b) const {
    double sum = 0;
    for (const auto& [at, weight] : a.weights)
      for (const auto& [other, other_weight] : b.weights)
        if (at == other) sum += weight * other_weight * variance_[at];
    return sum;
  }

  std::vector<std::vector<double>> rows_;  ///< deviations from the mean
  std::vector<double> mean_, variance_;
};

double log_rate(double mbps) { return std::log(positive_mbps(mbps)); }

/// Rate and quality fall with a coarser setting: what noise says against that is taken out.
void make_monotone(GridValues& grid) {
  const auto has_finer = [](std::size_t t) {
    return t > 0 && kTextureNodes[t].scale == kTextureNodes[t - 1].scale;
  };
  for (std::size_t e = 1; e < kErrors; ++e)
    grid.geometry_mbps[e] = std::min(grid.geometry_mbps[e], kFalls * grid.geometry_mbps[e - 1]);
  for (std::size_t t = 0; t < kTextures; ++t)
    if (has_finer(t))
      grid.texture_mbps[t] = std::min(grid.texture_mbps[t], kFalls * grid.texture_mbps[t - 1]);
  for (auto* ssim : {&grid.ssim, &grid.moving_ssim})
    for (std::size_t e = 0; e < kErrors; ++e)
      for (std::size_t t = 0; t < kTextures; ++t) {
        double& here = (*ssim)[e * kTextures + t];
        if (e > 0) here = std::min(here, (*ssim)[(e - 1) * kTextures + t]);
        if (has_finer(t)) here = std::min(here, (*ssim)[e * kTextures + t - 1]);
      }
}

}  // namespace

std::size_t CurvePredictor::value_count() { return kValues; }

CurvePredictor::CurvePredictor(FeatureSpace space, Members members)
    : space_(std::move(space)), members_(std::move(members)) {}

CurvePredictor CurvePredictor::train(std::span<const Sweep> training) {
  FeatureSpace space(training);
  Members members;
  for (const Sweep& sweep : training)
    (sweep.layers ? members.layers : members.without_layers)
        .push_back({space.at(sweep.features), values_of(sweep)});
  return {std::move(space), std::move(members)};
}

std::vector<double> CurvePredictor::values_given(const Observation& observed) const {
  const auto& kind = observed.layers ? members_.layers : members_.without_layers;
  const auto& members =
      kind.empty() ? (observed.layers ? members_.without_layers : members_.layers) : kind;
  MR_ASSERT(!members.empty());
  const std::vector<double> features = space_.at(observed.features);
  std::vector<Reading> readings;
  for (std::size_t i = 0; i < features.size(); ++i)
    readings.push_back({{{i, 1.0}}, features[i], kFeatureNoise});
  const std::size_t first =
      observed.produced.size() - std::min(observed.produced.size(), kMostReadings);
  const auto behind_features = [&](auto weights) {
    for (auto& [at, weight] : weights) at += features.size();
    return weights;
  };
  for (std::size_t i = first; i < observed.produced.size(); ++i) {
    const auto& produced = observed.produced[i];
    const auto age = static_cast<double>(observed.produced.size() - 1 - i);
    const double noise = std::hypot(kRateNoise, kAgeing * age);
    readings.push_back({behind_features(geometry_weights(produced.setting)),
                        log_rate(produced.geometry_mbps), noise});
    readings.push_back({behind_features(texture_weights(produced.setting)),
                        log_rate(produced.texture_mbps), noise});
  }
  std::vector<double> vector = Ensemble(members).given(readings);
  vector.erase(vector.begin(), vector.begin() + static_cast<std::ptrdiff_t>(features.size()));
  return vector;
}

RateSurface CurvePredictor::predict(const Observation& observed) const {
  GridValues grid = grid_of(values_given(observed));
  make_monotone(grid);
  if (!observed.produced.empty()) {
    const auto& newest = observed.produced.back();
    const RateSurface before(grid);
    const double geometry = positive_mbps(newest.geometry_mbps) /
                            before.geometry_mbps(newest.setting.error_voxels, newest.setting.bits),
                 texture = positive_mbps(newest.texture_mbps) /
                           before.texture_mbps(newest.setting.scale, newest.setting.qp);
    for (double& mbps : grid.geometry_mbps) mbps *= geometry;
    for (double& mbps : grid.texture_mbps) mbps *= texture;
  }
  return RateSurface(weighted(std::move(grid), observed.moving_weight));
}

RoomValues CurvePredictor::predict_room(const Observation& observed) const {
  return room_of(&values_given(observed)[kRoomAt]);
}

std::vector<RatePoint> CurvePredictor::allowed_points(const Observation& observed) const {
  std::vector<RatePoint> points = candidate_points(predict(observed), observed.bits);
  const auto is_allowed = [&](const RatePoint& p) {
    return p.setting.error_voxels >= observed.least_error_voxels &&
           p.setting.error_voxels <= observed.coarsest_error_voxels;
  };
  if (std::ranges::any_of(points, is_allowed)) std::erase_if(points, std::not_fn(is_allowed));
  return points;
}

Setting CurvePredictor::choose(const Observation& observed, double target_mbps) const {
  return best_within(allowed_points(observed), target_mbps).setting;
}

double CurvePredictor::backlog_share(const Observation& observed, const Backlog& backlog,
                                     double target_mbps) const {
  if (!observed.layers) return kUsualBacklogShare;
  const double error_voxels = observed.produced.empty()
                                  ? kUsualSetting.error_voxels
                                  : observed.produced.back().setting.error_voxels;
  const double lacking =
      (1 - observed.moving_weight) * loss_of(backlog, predict_room(observed), error_voxels);
  return share_until_sent(allowed_points(observed), target_mbps, lacking);
}

}  // namespace mr::rate
