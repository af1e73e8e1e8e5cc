#include "mr/rate/simulation.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace mr::rate {
namespace {

/// A walk between 0 and 1 that keeps each value for a while; by seed.
std::vector<double> random_walk(std::uint64_t seed, int steps, double step, double jump_chance) {
  std::mt19937_64 random(seed);
  // Not the library's distributions: their results differ between libraries.
  const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  std::vector<double> out;
  double at = 0.7;
  for (int i = 0; i < steps; ++i) {
    at = uniform() < jump_chance ? uniform() : at + step * (2 * uniform() - 1);
    at = at < 0 ? -at : at;
    at = at > 1 ? 2 - at : at;
    out.push_back(std::clamp(at, 0.0, 1.0));
  }
  return out;
}

double between(double low, double high, double share) { return low * std::pow(high / low, share); }

/// What a capture of the simulated scene takes.
class SimulatedScene {
 public:
  SimulatedScene(const Sweep& sweep, std::uint64_t seed)
      : surface_(grid_values(sweep)), fps_(sweep.fps), random_(seed) {
    double key = 0, other = 0;
    for (const Sweep::Texture& t : sweep.textures) key += t.key_bytes, other += t.bytes;
    key_ratio_ = other > 0 ? std::max(key / other, 1.0) : 1;
  }

  CaptureBytes capture(const Setting& setting, bool key_frame, double busier) {
    noise_ = 0.9 * noise_ + 0.03 * normal();
    const double more = busier * std::exp(noise_);
    CaptureBytes out;
    out.key_frame = key_frame;
    out.geometry = more * bytes(surface_.geometry_mbps(setting.error_voxels));
    const double mean = bytes(surface_.texture_mbps(setting.scale, setting.qp));
    const double other = mean * fps_ / (fps_ - 1 + key_ratio_);
    out.texture = more * std::exp(0.05 * normal()) * (key_frame ? key_ratio_ : 1) * other;
    return out;
  }
  double ssim(const Setting& setting) const { return surface_.ssim(setting); }

 private:
  double bytes(double mbps) const { return mbps * 1e6 / 8 / fps_; }
  /// Of about a normal distribution: a sum of twelve uniform ones.
  double normal() {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += static_cast<double>(random_() >> 11) * 0x1p-53;
    return sum;
  }

  RateSurface surface_;
  double fps_, key_ratio_ = 1, noise_ = 0;
  std::mt19937_64 random_;
};

}  // namespace

std::vector<Trace> traces(double low, double high, std::uint64_t seed) {
  const auto walk = [=](std::vector<double> steps, double every_s) {
    return [=](double s) {
      const auto i = static_cast<std::size_t>(std::max(s, 0.0) / every_s) % steps.size();
      return between(low, high, steps[i]);
    };
  };
  return {
      {"constant", [=](double) { return between(low, high, 0.6); }},
      {"steps", [=](double s) { return std::fmod(s, 20) < 10 ? high : low; }},
      {"ramp", [=](double s) { return between(low, high, std::abs(std::fmod(s / 20, 2) - 1)); }},
      {"wifi", walk(random_walk(seed, 600, 0.15, 0.05), 0.5)},
      {"cellular", walk(random_walk(seed + 1, 300, 0.4, 0.15), 1.0)}};
}

SimulationResult simulate(Controller& controller, const Sweep& sweep, const Trace& trace,
                          std::span<const Burst> bursts, double seconds, std::uint64_t seed,
                          int key_frame_every) {
  SimulationResult out;
  SimulatedScene scene(sweep, seed);
  controller.set_features(sweep.features);
  const int captures = static_cast<int>(std::lround(seconds * sweep.fps));
  double backlog = 0, busier = 1, busy_until_s = 0, target_before = 0, stepped_s = -1;
  bool key_frame = true;
  for (int i = 0; i < captures; ++i) {
    const double s = i / sweep.fps;
    if (i % static_cast<int>(std::lround(sweep.fps)) == 0) out.seconds.emplace_back();
    SimulatedSecond& second = out.seconds.back();
    for (const Burst& burst : bursts)
      if (i == static_cast<int>(std::lround(burst.at_s * sweep.fps))) {
        backlog += burst.still_bytes, key_frame |= burst.key_frame;
        busier = burst.busier, busy_until_s = s + 2;
      }
    key_frame |= key_frame_every > 0 && i % key_frame_every == 0;
    const double target = trace.mbps(s);
    if (i > 0 && std::abs(target / target_before - 1) > 0.3 && stepped_s < 0) stepped_s = s;
    target_before = target;
    controller.set_target(target);
    const Setting before = controller.setting();
    const CapturePlan plan = controller.next(backlog, key_frame);
    second.changes += before != controller.setting();
    CaptureBytes sent;
    if (plan.skipped) {
      ++second.skipped;
    } else {
      sent = scene.capture(plan.setting, key_frame, s < busy_until_s ? busier : 1);
      key_frame = false;
    }
    sent.refinement = std::min(plan.refinement, backlog);
    backlog -= sent.refinement;
    controller.sent(sent);
    const double mbps = (sent.geometry + sent.texture + sent.refinement) * 8e-6 * sweep.fps;
    if (stepped_s >= 0 && mbps < 1.15 * target) {
      out.response_s = std::max(out.response_s, s - stepped_s);
      stepped_s = -1;
    }
    second.target_mbps += target / sweep.fps, second.mbps += mbps / sweep.fps;
    second.refinement_mbps += sent.refinement * 8e-6;
    second.ssim += scene.ssim(plan.setting) / sweep.fps;
  }
  return out;
}

}  // namespace mr::rate
