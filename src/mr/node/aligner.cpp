#include "mr/node/aligner.h"

#include <algorithm>

namespace mr::node {

Aligner::Aligner(std::size_t inputs, Duration period, Duration deadline)
    : period_(period), deadline_(deadline), newest_(inputs) {}

TimePoint Aligner::tick_of(TimePoint captured_at) const {
  const auto since = captured_at.time_since_epoch() + period_ / 2;
  auto ticks = since / period_;
  if (since.count() < 0 && since % period_ != Duration::zero()) --ticks;  // floor
  return TimePoint(ticks * period_);
}

void Aligner::arrived(std::size_t input, TimePoint captured_at, TimePoint now) {
  const TimePoint tick = tick_of(captured_at);
  auto& newest = newest_[input];
  if (!newest || tick > *newest) newest = tick;
  if (last_merged_ && tick <= *last_merged_) return;
  if (!pending_) pending_ = tick, pending_since_ = now;
  pending_ = std::max(*pending_, tick);
}

std::optional<TimePoint> Aligner::ready(TimePoint now) const {
  if (!pending_) return std::nullopt;
  // An input that has gone is not waited for.
  const bool all = std::all_of(newest_.begin(), newest_.end(), [&](const auto& tick) {
    return tick ? *tick >= *pending_ || *pending_ - *tick > kMaxAge : last_merged_.has_value();
  });
  return all || now - pending_since_ >= deadline_ ? pending_ : std::nullopt;
}

std::vector<std::size_t> Aligner::live_at(TimePoint tick) const {
  std::vector<std::size_t> live;
  for (std::size_t i = 0; i < newest_.size(); ++i)
    if (newest_[i] && tick - *newest_[i] <= kMaxAge) live.push_back(i);
  return live;
}

void Aligner::merged(TimePoint tick, TimePoint now) {
  last_merged_ = tick;
  pending_.reset();
  for (const auto& newest : newest_)
    if (newest && *newest > tick) pending_ = std::max(pending_.value_or(*newest), *newest);
  if (pending_) pending_since_ = now;
}

}  // namespace mr::node
