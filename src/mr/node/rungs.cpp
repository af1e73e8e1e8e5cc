#include "mr/node/rungs.h"

#include <algorithm>
#include <chrono>
#include <thread>

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
      rungs_(names_.size()),
      beginnings_(names_.size()) {
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

Rungs::~Rungs() = default;

/// The rung's node; null: nobody wants it now, or it begins in the background.
std::shared_ptr<MergeNode> Rungs::wanted(std::size_t rung, const CaptureSet& captures,
                                         const MergeNode& top, TimePoint now) {
  std::shared_ptr<MergeNode> old;
  {
    const std::lock_guard lock(mutex_);
    Rung& asked = rungs_[rung];
    if (!asked.wanted_mbps) return nullptr;
    const Duration since = now - asked.wanted_at;
    if (since <= kPatience && asked.node) return asked.node;
    if (since > kPatience && since <= kKept) return nullptr;
    if (since > kKept) old = std::move(asked.node), asked = {};
  }
  if (!old) return start(rung, captures, top);
  end(std::move(old));
  return nullptr;
}

std::shared_ptr<MergeNode> Rungs::start(std::size_t rung, const CaptureSet& captures,
                                        const MergeNode& top) {
  MergerConfig config = root_;
  config.id = names_[rung];
  NodeClock clock = options_.clock;
  clock.epoch = clock.now ? NodeClock::live().epoch : clock.epoch + ++starts_;
  const auto node = std::make_shared<MergeNode>(*scene_, config, true, clock, options_.still_work);
  node->set_background(options_.background);
  node->control_rate(options_.model);
  node->atlas().recall(top.atlas().memory());
  const std::lock_guard lock(mutex_);
  codec::Control target;
  target.target_mbps = rungs_[rung].wanted_mbps;
  node->answer(target);
  rungs_[rung].node = node;
  if (options_.still_work == StillWork::at_once) return node;
  beginnings_[rung].start([node, captures] { return node->merge(captures); });
  return nullptr;
}

/// A node waits for its job beside, which takes its time; and an answer() may still be using it.
void Rungs::end(std::shared_ptr<MergeNode> node) {
  ended_ = std::async(std::launch::async, [node = std::move(node)] {
    while (node.use_count() > 1) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  });
}

Rungs::Packets Rungs::merge(const CaptureSet& captures, const MergeNode& top, Duration took,
                            TimePoint now, std::vector<Missing>& missing) {
  constexpr int kMostDebt = 2;  // captures' worth: a rung that begins does not stop the others
  const auto& clock = options_.clock.now;
  Packets out;
  const auto add = [&](std::size_t rung, Bytes bytes) {
    if (bytes)
      out.emplace_back(rung, *std::move(bytes));
    else
      missing.push_back({rung, bytes.error()});
  };
  time_left_ = std::min(time_left_ + took, took);
  bool is_any_left_out = false;
  const std::size_t first = first_;
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const std::size_t rung = (first + i) % names_.size();
    const TimePoint begun = clock ? clock() : TimePoint{};
    if (beginnings_[rung].is_busy()) {
      if (auto bytes = beginnings_[rung].take()) add(rung, *std::move(bytes));
      continue;
    }
    const std::shared_ptr<MergeNode> node = wanted(rung, captures, top, now);
    if (!node) continue;
    if (clock && time_left_ < Duration{}) {
      if (!std::exchange(is_any_left_out, true)) first_ = rung;  // it is the first next time
      missing.push_back({rung, {Error::Cause::over_budget, "a tick left out: there is no time"}});
      continue;
    }
    auto bytes = node->merge(captures);
    if (clock) time_left_ = std::max(time_left_ - (clock() - begun), -kMostDebt * took);
    node->take_shown();
    add(rung, std::move(bytes));
  }
  return out;
}

}  // namespace mr::node
