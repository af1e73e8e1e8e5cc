#include "mr/node/rungs.h"

#include <algorithm>
#include <chrono>

#include "mr/core/assert.h"

namespace mr::node {

std::vector<std::string> rung_names(const Scene& scene) {
  std::vector<std::string> out;
  if (scene.rate.model == RateConfig::Model::fixed) return out;
  for (int i = 1; i < scene.rate.rungs; ++i)
    out.push_back(scene.mergers.back().id + "~" + std::to_string(i));
  return out;
}

Rungs::Rungs(const Scene& scene, const MergerConfig& root, Options options)
    : scene_(&scene),
      root_(root),
      options_(std::move(options)),
      names_(rung_names(scene)),
      rungs_(names_.size()) {
  MR_ASSERT(options_.model);
}

std::vector<std::byte> Rungs::answer(std::size_t rung, const codec::Control& request,
                                     TimePoint now) {
  std::shared_ptr<MergeNode> node;
  {
    const std::lock_guard lock(mutex_);
    Rung& asked = rungs_.at(rung);
    if (request.target_mbps) asked.wanted_mbps = request.target_mbps, asked.wanted_at = now;
    node = asked.node;
  }
  return node ? node->answer(request) : std::vector<std::byte>();
}

/// The rung's node, begun or ended as is wanted; null: nobody wants it.
std::shared_ptr<MergeNode> Rungs::started(std::size_t rung, const MergeNode& top, TimePoint now) {
  std::optional<double> mbps;
  std::shared_ptr<MergeNode> node;
  {
    const std::lock_guard lock(mutex_);
    Rung& wanted = rungs_[rung];
    if (wanted.wanted_mbps && now - wanted.wanted_at > kPatience) wanted = {};
    mbps = wanted.wanted_mbps, node = wanted.node;
  }
  if (node || !mbps) return node;
  MergerConfig config = root_;
  config.id = names_[rung];
  NodeClock clock = options_.clock;
  clock.epoch = clock.now ? NodeClock::live().epoch : clock.epoch + ++starts_;
  node = std::make_shared<MergeNode>(*scene_, config, true, clock, options_.still_work);
  node->set_background(options_.background);
  node->control_rate(options_.model);
  node->atlas().recall(top.atlas().memory());
  codec::Control target;
  target.target_mbps = mbps;
  node->answer(target);
  const std::lock_guard lock(mutex_);
  rungs_[rung].node = node;
  return node;
}

Rungs::Packets Rungs::merge(const CaptureSet& captures, const MergeNode& top, Duration took,
                            TimePoint now, std::vector<Error>& failed) {
  Packets out;
  time_left_ = std::min(time_left_ + took, took);
  bool is_any_left_out = false;
  const std::size_t first = first_;
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const std::size_t rung = (first + i) % names_.size();
    const std::shared_ptr<MergeNode> node = started(rung, top, now);
    if (!node) continue;
    const auto& clock = options_.clock.now;
    if (clock && time_left_ < Duration{}) {
      if (!std::exchange(is_any_left_out, true)) first_ = rung;  // it is the first next time
      continue;
    }
    const TimePoint begun = clock ? clock() : TimePoint{};
    auto bytes = node->merge(captures);
    if (clock) time_left_ -= clock() - begun;
    node->take_shown();
    if (bytes)
      out.emplace_back(rung, *std::move(bytes));
    else if (bytes.error().cause != Error::Cause::over_budget)
      failed.push_back(bytes.error());
  }
  return out;
}

}  // namespace mr::node
