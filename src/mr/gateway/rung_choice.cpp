#include "mr/gateway/rung_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace mr::gateway {

RungChoice::RungChoice(std::size_t streams, double most_mbps)
    : most_mbps_(most_mbps), rates_(streams) {
  rates_.front() = most_mbps;
}

void RungChoice::opened(net::ViewerId viewer, TimePoint now) {
  viewers_[viewer] = {};
  viewers_[viewer].opened = now;
}

bool RungChoice::want(net::ViewerId viewer, double mbps) {
  if (!std::isfinite(mbps) || mbps <= 0) return false;
  if (const auto found = viewers_.find(viewer); found != viewers_.end())
    found->second.wanted_mbps = std::min(mbps, most_mbps_);
  return true;
}

/// A newcomer that has said nothing takes what there is, for a moment.
double RungChoice::wanted(const Viewer& viewer, TimePoint now) const {
  if (viewer.wanted_mbps) return *viewer.wanted_mbps;
  const bool is_alone = viewers_.size() == 1;
  return !is_alone && now - viewer.opened < kNew ? *rates_.front() : most_mbps_;
}

void RungChoice::update(TimePoint now) {
  std::vector<double> all;
  for (const auto& [id, viewer] : viewers_) all.push_back(wanted(viewer, now));
  if (all != wanted_ || ladder_.empty()) {
    wanted_ = all;
    ladder_ = rate::ladder_for(std::move(all), rates_.size());
    if (ladder_.empty()) ladder_ = {most_mbps_};
  }
  const double before = *rates_.front();
  assign();
  find_moves(now);
  if (is_raise_held(before, now)) rates_.front() = before;
}

/// Somebody is still there who wants less.
bool RungChoice::is_raise_held(double before, TimePoint now) const {
  return *rates_.front() > before && std::ranges::any_of(viewers_, [&](const auto& item) {
    const Viewer& viewer = item.second;
    return viewer.stream == 0 && viewer.leaves && now - *viewer.leaves < kLeave;
  });
}

/// Gives each rung a stream: the highest the root's own, the others those whose rates are nearest
/// to theirs so far.
void RungChoice::assign() {
  const std::vector<std::optional<double>> before =
      std::exchange(rates_, std::vector<std::optional<double>>(rates_.size()));
  rates_.front() = ladder_.front();
  stream_of_.assign(ladder_.size(), 0);
  constexpr double kUnused = 10;  // farther than any change of a rate in use
  const auto distance = [&](std::size_t rung, std::size_t stream) {
    return before[stream] ? std::abs(std::log(ladder_[rung] / *before[stream])) : kUnused;
  };
  for (std::size_t left = ladder_.size() - 1; left > 0; --left) {
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t rung = 0, stream = 0;
    for (std::size_t r = 1; r < ladder_.size(); ++r)
      for (std::size_t s = 1; s < rates_.size(); ++s)
        if (stream_of_[r] == 0 && !rates_[s] && distance(r, s) < nearest)
          nearest = distance(r, s), rung = r, stream = s;
    stream_of_[rung] = stream, rates_[stream] = ladder_[rung];
  }
}

void RungChoice::find_moves(TimePoint now) {
  moves_.clear();
  for (auto& [id, viewer] : viewers_) {
    const std::size_t stream = stream_of_[rate::rung_for(wanted(viewer, now), ladder_)];
    if (stream == viewer.stream) {
      viewer.leaves.reset();
      continue;
    }
    if (!viewer.leaves) viewer.leaves = now;
    if (!viewer.moved || now - *viewer.moved >= kStay) moves_.emplace_back(id, stream);
  }
}

std::size_t RungChoice::served_by(net::ViewerId viewer) const {
  const auto found = viewers_.find(viewer);
  return found == viewers_.end() ? 0 : found->second.stream;
}

void RungChoice::moved(net::ViewerId viewer, std::size_t stream, TimePoint now) {
  Viewer& of = viewers_.at(viewer);
  of.stream = stream, of.moved = now;
  of.leaves.reset();
  std::erase_if(moves_, [&](const auto& move) { return move.first == viewer; });
}

}  // namespace mr::gateway
