#include "mr/rate/simulation.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>
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

  /// The next capture; `busier`: by which factor more moves than usually.
  void capture(double busier) {
    noise_ = 0.9 * noise_ + 0.03 * normal();
    more_ = busier * std::exp(noise_);
    more_texture_ = more_ * std::exp(0.05 * normal());
  }
  double geometry(const Setting& setting) const {
    return more_ * bytes(surface_.geometry_mbps(setting.error_voxels));
  }
  double texture(const Setting& setting, bool key_frame) const {
    const double mean = bytes(surface_.texture_mbps(setting.scale, setting.qp));
    const double other = mean * fps_ / (fps_ - 1 + key_ratio_);
    return more_texture_ * (key_frame ? key_ratio_ : 1) * other;
  }
  double ssim(const Setting& setting) const { return surface_.at(setting).ssim; }

 private:
  double bytes(double mbps) const { return mbps * 1e6 / 8 / fps_; }
  /// Of about a normal distribution: a sum of twelve uniform ones.
  double normal() {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += static_cast<double>(random_() >> 11) * 0x1p-53;
    return sum;
  }

  RateSurface surface_;
  double fps_, key_ratio_ = 1, noise_ = 0, more_ = 1, more_texture_ = 1;
  std::mt19937_64 random_;
};

/// The time from a step of the target by over 30 % until the stream follows: until the mean of
/// three captures, or of all since the step, is within 15 % of the target, or below it at the
/// finest quantiser. Of all, as single captures take a multiple where others are left out.
class Steps {
 public:
  explicit Steps(double fps) : fps_(fps) {}

  void add(double s, double target, double mbps, const CapturePlan& plan) {
    if (last_target_ > 0 && std::abs(target / last_target_ - 1) > 0.3)
      since_s_ = s, recent_.clear(), sum_ = 0, captures_ = 0;
    last_target_ = target;
    recent_.push_back(mbps);
    if (recent_.size() > 3) recent_.pop_front();
    sum_ += mbps, ++captures_;
    if (!since_s_ || plan.skipped) return;
    const bool is_finest = plan.setting.qp <= kTextureNodes[0].qp;
    const auto is_near = [&](double mean) {
      return mean <= 1.15 * target && (mean >= 0.85 * target || is_finest);
    };
    double recent = 0;
    for (const double one : recent_) recent += one / static_cast<double>(recent_.size());
    const bool follows = captures_ >= 3 && is_near(sum_ / captures_);
    if (!is_near(recent) && !follows) return;
    longest_s_ = std::max(longest_s_, s - *since_s_ + 1 / fps_);
    since_s_.reset();
  }
  /// A step that was not followed by the end counts until then.
  double longest_s(double end_s) const {
    return since_s_ ? std::max(longest_s_, end_s - *since_s_) : longest_s_;
  }

 private:
  double fps_, last_target_ = 0, longest_s_ = 0;
  double sum_ = 0;  ///< Mbit/s of the captures since the step
  int captures_ = 0;
  std::optional<double> since_s_;  ///< a step that is not followed yet
  std::deque<double> recent_;      ///< Mbit/s of single captures
};

/// What waits: still surface, and behind it plates, coarse at first, that become finer with every
/// byte.
class SimulatedBacklog {
 public:
  void add(const Burst& burst) {
    still_ += burst.still_bytes;
    plates_ += burst.plate_bytes, all_plates_ = plates_;
  }
  double bytes() const { return still_ + plates_; }
  void send(double bytes) {
    const double of_still = std::min(bytes, still_);
    still_ -= of_still, plates_ -= bytes - of_still;
  }
  Backlog waiting() const {
    const double left = all_plates_ > 0 ? plates_ / all_plates_ : 0;
    return {still_, plates_, still_, kBestPlateQp + left * (kCoarsestPlateQp - kBestPlateQp),
            kBestPlateQp};
  }

 private:
  double still_ = 0, plates_ = 0, all_plates_ = 0;
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
  const RoomValues room = room_values(sweep);
  Steps steps(sweep.fps);
  controller.set_features(sweep.features);
  const int captures = static_cast<int>(std::lround(seconds * sweep.fps));
  SimulatedBacklog backlog;
  double busier = 1, busy_until_s = 0, shown_ssim = 0;
  bool key_frame_needed = false;
  for (int i = 0; i < captures; ++i) {
    const double s = i / sweep.fps;
    if (i % static_cast<int>(std::lround(sweep.fps)) == 0) out.seconds.emplace_back();
    SimulatedSecond& second = out.seconds.back();
    bool key_frame = i == 0 || (key_frame_every > 0 && i % key_frame_every == 0);
    for (const Burst& burst : bursts)
      if (i == static_cast<int>(std::lround(burst.at_s * sweep.fps))) {
        backlog.add(burst), key_frame |= burst.key_frame;
        busier = burst.busier, busy_until_s = s + 2;
      }
    const double target = trace.mbps(s);
    controller.set_target(target);
    const Setting before = controller.setting();
    CapturePlan plan = controller.begin(backlog.waiting());
    second.changes += before != controller.setting();
    second.skipped += plan.skipped;
    CaptureBytes sent;
    key_frame_needed |= key_frame || plan.key_frame;
    if (!plan.skipped) {
      scene.capture(s < busy_until_s ? busier : 1);
      const CaptureBudget budget =
          controller.code({scene.geometry(plan.setting), backlog.bytes(), key_frame_needed});
      plan.setting.qp = budget.qp;
      sent = {scene.geometry(plan.setting), scene.texture(plan.setting, key_frame_needed),
              key_frame_needed, std::min(budget.refinement, backlog.bytes())};
      key_frame_needed = false;
      shown_ssim = scene.ssim(plan.setting);
    }
    backlog.send(sent.refinement);
    controller.sent(sent);
    const double mbps = (sent.geometry + sent.texture + sent.refinement) * 8e-6 * sweep.fps;
    steps.add(s, target, mbps, plan);
    second.target_mbps += target / sweep.fps, second.mbps += mbps / sweep.fps;
    second.refinement_mbps += sent.refinement * 8e-6;
    second.ssim += shown_ssim / sweep.fps;
    second.lacking += loss_of(backlog.waiting(), room, plan.setting.error_voxels) / sweep.fps;
  }
  out.response_s = steps.longest_s(captures / sweep.fps);
  return out;
}

}  // namespace mr::rate
