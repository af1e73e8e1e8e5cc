#include "mr/gateway/rung_choice.h"

#include <algorithm>
#include <cmath>

namespace mr::gateway {

void RungChoice::opened(net::ViewerId viewer) {
  viewers_[viewer] = {most_mbps_, 0};
  ladder_.clear();
}

void RungChoice::closed(net::ViewerId viewer) {
  viewers_.erase(viewer);
  ladder_.clear();
}

bool RungChoice::want(net::ViewerId viewer, double mbps) {
  if (!std::isfinite(mbps) || mbps <= 0) return false;
  const auto found = viewers_.find(viewer);
  if (found == viewers_.end()) return true;
  found->second.wanted_mbps = std::min(mbps, most_mbps_);
  ladder_.clear();
  return true;
}

const std::vector<double>& RungChoice::ladder() {
  if (!ladder_.empty()) return ladder_;
  std::vector<double> wanted;
  for (const auto& [id, viewer] : viewers_) wanted.push_back(viewer.wanted_mbps);
  ladder_ = rate::ladder_for(std::move(wanted), most_rungs_);
  if (ladder_.empty()) ladder_ = {most_mbps_};
  return ladder_;
}

std::size_t RungChoice::served_by(net::ViewerId viewer) const {
  const auto found = viewers_.find(viewer);
  return found == viewers_.end() ? 0 : found->second.rung;
}

std::vector<std::pair<net::ViewerId, std::size_t>> RungChoice::moves() {
  std::vector<std::pair<net::ViewerId, std::size_t>> out;
  for (const auto& [id, viewer] : viewers_)
    if (const std::size_t rung = rate::rung_for(viewer.wanted_mbps, ladder()); rung != viewer.rung)
      out.emplace_back(id, rung);
  return out;
}

}  // namespace mr::gateway
