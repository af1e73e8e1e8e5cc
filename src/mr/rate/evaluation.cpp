#include "mr/rate/evaluation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <string>

#include "mr/rate/curve_predictor.h"
#include "mr/rate/room.h"

namespace mr::rate {
namespace {

constexpr double kOver = 1.03;  // of the target

Observation::Produced produced_at(const RateSurface& truth, const Setting& setting) {
  return {setting, truth.geometry_mbps(setting.error_voxels, setting.bits),
          truth.texture_mbps(setting.scale, setting.qp)};
}

/// The model chooses, sees what its choice costs, and chooses again.
Prediction predict(const Model& model, const Sweep& sweep, const RateSurface& truth,
                   double target_mbps, const Corrections& corrections) {
  using Clock = std::chrono::steady_clock;
  Observation observed;
  observed.layers = sweep.layers, observed.features = sweep.features;
  observed.moving_weight = corrections.moving_weight;
  if (corrections.sees_produced) observed.produced = {produced_at(truth, kUsualSetting)};
  Prediction out;
  out.scene = sweep.scene, out.layers = sweep.layers;
  out.target_mbps = out.limit_mbps = target_mbps, out.usual = truth.at(kUsualSetting);
  for (int i = 0; i < corrections.choices; ++i) {
    const auto start = Clock::now();
    const Setting setting = model.choose(observed, target_mbps);
    out.decision_ms = std::max(
        out.decision_ms, std::chrono::duration<double, std::milli>(Clock::now() - start).count());
    observed.bits = setting.bits;  // of the whole epoch
    const bool is_settled = i > 0 && setting == out.got.setting;
    out.got = truth.at(setting);
    if (is_settled) break;
    if (corrections.sees_produced) observed.produced.push_back(produced_at(truth, setting));
  }
  return out;
}

std::vector<Sweep> without_scene(std::span<const Sweep> sweeps, const std::string& scene) {
  std::vector<Sweep> out;
  std::ranges::copy_if(sweeps, std::back_inserter(out),
                       [&](const Sweep& s) { return s.scene != scene; });
  return out;
}

bool is_node(const Setting& setting) {
  return std::ranges::find(kErrorNodes_voxels, setting.error_voxels) !=
             std::end(kErrorNodes_voxels) &&
         std::ranges::any_of(kTextureNodes, [&](const TextureNode& node) {
           return node.scale == setting.scale && node.qp == setting.qp;
         });
}

}  // namespace

double gap_to_hull(const std::vector<RatePoint>& hull, double target_mbps, const RatePoint& got) {
  const double best = hull_ssim(hull, target_mbps);
  // A target below the hull's lowest point is met by nothing: that point is best effort.
  const bool is_over = got.mbps > kOver * std::max(target_mbps, hull.front().mbps);
  return std::max(0.0, best - (is_over ? hull.front().ssim : got.ssim));
}

GapStatistics statistics(std::span<const Prediction> predictions) {
  GapStatistics out;
  if (predictions.empty()) return out;
  std::vector<double> gaps;
  for (const Prediction& p : predictions) {
    gaps.push_back(p.gap);
    out.mean += p.gap, out.max = std::max(out.max, p.gap);
    out.over += p.got.mbps > kOver * p.limit_mbps;
    out.rate_error += std::abs(p.got.mbps / p.limit_mbps - 1);
    const double loss = p.usual.ssim - p.got.ssim;
    out.mean_loss += loss, out.most_loss = std::max(out.most_loss, loss);
    out.mean_moving_loss += p.moving_loss;
  }
  const auto n = static_cast<double>(gaps.size());
  out.mean /= n, out.over /= n, out.rate_error /= n, out.mean_loss /= n;
  out.mean_moving_loss /= n;
  std::ranges::sort(gaps);
  out.p95 = gaps[static_cast<std::size_t>(0.95 * (n - 1))];
  return out;
}

InterpolationError interpolation_error(std::span<const Sweep> sweeps) {
  InterpolationError out;
  for (const Sweep& sweep : sweeps) {
    const RateSurface surface(grid_values(sweep));
    for (const RatePoint& measured : measured_points(sweep)) {
      if (measured.setting.bits != kBits || is_node(measured.setting)) continue;
      const RatePoint between = surface.at(measured.setting);
      const double rate = std::abs(between.mbps / measured.mbps - 1),
                   ssim = std::abs(between.ssim - measured.ssim);
      ++out.points;
      out.mean_rate += rate, out.most_rate = std::max(out.most_rate, rate);
      out.mean_ssim += ssim, out.most_ssim = std::max(out.most_ssim, ssim);
    }
  }
  const double n = std::max<double>(static_cast<double>(out.points), 1);
  out.mean_rate /= n, out.mean_ssim /= n;
  return out;
}

RoomError room_error(std::span<const Sweep> sweeps) {
  RoomError out;
  for (const Sweep& sweep : sweeps) {
    const std::vector<Sweep> others = without_scene(sweeps, sweep.scene);
    if (sweep.plates.empty() || sweep.stills.empty() || others.empty()) continue;
    Observation observed;
    observed.layers = sweep.layers, observed.features = sweep.features;
    const RoomValues got = CurvePredictor::train(others).predict_room(observed),
                     truth = room_values(sweep);
    const auto off = [](double a, double b) { return std::abs(a / b - 1); };
    for (std::size_t i = 0; i < truth.plate_bytes.size(); ++i) {
      const auto n = static_cast<double>(truth.plate_bytes.size());
      out.plate_bytes += off(got.plate_bytes[i], truth.plate_bytes[i]) / n;
      out.plate_loss += std::abs(got.plate_loss[i] - truth.plate_loss[i]) / n;
    }
    out.still_bytes += off(got.still_bytes, truth.still_bytes);
    for (std::size_t i = 0; i < truth.still_loss.size(); ++i)
      out.still_loss += std::abs(got.still_loss[i] - truth.still_loss[i]) /
                        static_cast<double>(truth.still_loss.size());
    ++out.scenes;
  }
  for (double* sum : {&out.plate_bytes, &out.still_bytes, &out.plate_loss, &out.still_loss})
    *sum /= std::max<double>(static_cast<double>(out.scenes), 1);
  return out;
}

std::vector<Prediction> leave_one_out(std::span<const Sweep> sweeps, const Trainer& train,
                                      const Targets& targets, const Corrections& corrections) {
  std::vector<Prediction> out;
  for (auto first = sweeps.begin(); first != sweeps.end();) {
    const auto end =
        std::find_if(first, sweeps.end(), [&](const Sweep& s) { return s.scene != first->scene; });
    const std::unique_ptr<Model> model = train(without_scene(sweeps, first->scene));
    for (; first != end; ++first) {
      const GridValues values = grid_values(*first);
      const RateSurface truth(values), moving(weighted(values, 1));
      const auto hull = convex_hull(candidate_points(truth));
      for (const double target : targets(hull, truth.at(kUsualSetting).mbps)) {
        Prediction p = predict(*model, *first, truth, target, corrections);
        p.gap = gap_to_hull(hull, target, p.got);
        p.moving_loss = moving.at(kUsualSetting).ssim - moving.at(p.got.setting).ssim;
        p.limit_mbps = std::max(target, hull.front().mbps);
        out.push_back(std::move(p));
      }
    }
  }
  return out;
}

}  // namespace mr::rate
