#include "mr/node/aligner.h"

#include <algorithm>

namespace mr::node {

Aligner::Aligner(std::size_t inputs, Duration period, Duration deadline)
    : period_(period), deadline_(deadline), inputs_(inputs) {}

TimePoint Aligner::tick_of(TimePoint captured_at) const {
  const auto since = captured_at.time_since_epoch() + period_ / 2;
  auto ticks = since / period_;
  if (since.count() < 0 && since % period_ != Duration::zero()) --ticks;  // floor
  return TimePoint(ticks * period_);
}

void Aligner::arrived(std::size_t input, TimePoint captured_at, TimePoint now) {
  // An input whose clock is ahead must not move the ticks into the future.
  const TimePoint present = tick_of(now), tick = std::min(tick_of(captured_at), present);
  const bool set_back = std::any_of(inputs_.begin(), inputs_.end(), [&](const Input& i) {
    return i.newest && *i.newest - present > kMaxAge;
  });
  if (set_back) *this = Aligner(inputs_.size(), period_, deadline_);
  Input& from = inputs_[input];
  if (!from.newest || tick > *from.newest)
    from = {tick, from.newest ? tick - *from.newest : Duration{}, true};
  if (last_merged_ && tick <= *last_merged_) return;
  if (!pending_) pending_ = tick, pending_since_ = now;
  pending_ = std::max(*pending_, tick);
}

bool Aligner::is_live(const Input& input, TimePoint tick) {
  if (!input.newest) return false;
  const bool is_slow = input.interval <= kSlowest;  // else the input was missing
  return tick - *input.newest <= (is_slow ? std::max(kMaxAge, input.interval * 5 / 2) : kMaxAge);
}

std::optional<TimePoint> Aligner::ready(TimePoint now) const {
  if (!pending_) return std::nullopt;
  // Inputs that are not live are not waited for.
  const bool all = std::all_of(inputs_.begin(), inputs_.end(), [&](const Input& input) {
    if (!input.newest) return last_merged_.has_value();
    return input.is_new || *input.newest >= *pending_ || !is_live(input, *pending_);
  });
  return all || now - pending_since_ >= deadline_ ? pending_ : std::nullopt;
}

std::vector<std::size_t> Aligner::live_at(TimePoint tick) const {
  std::vector<std::size_t> live;
  for (std::size_t i = 0; i < inputs_.size(); ++i)
    if (is_live(inputs_[i], tick)) live.push_back(i);
  return live;
}

void Aligner::merged(TimePoint tick, TimePoint now) {
  last_merged_ = tick;
  pending_.reset();
  for (Input& input : inputs_) {
    input.is_new = input.newest && *input.newest > tick;
    if (input.is_new) pending_ = std::max(pending_.value_or(*input.newest), *input.newest);
  }
  if (pending_) pending_since_ = now;
}

}  // namespace mr::node
