#include "mr/rate/link_budget.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "mr/rate/setting.h"

namespace mr::rate {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

}  // namespace

std::optional<double> LinkBudget::limit_mbps() const {
  if (!scene_limit_mbps_ || !measured_mbps_)
    return scene_limit_mbps_ ? scene_limit_mbps_ : measured_mbps_;
  return std::min(*scene_limit_mbps_, *measured_mbps_);
}

void LinkBudget::arrived(double bytes, std::optional<TimePoint> sent, TimePoint came) {
  if (!first_) first_ = came;
  second_.push_back({came, bytes});
  while (came - second_.front().came > seconds(1)) second_.pop_front();
  double sum = 0;
  for (const Arrival& arrival : second_) sum += arrival.bytes;
  mbps_ = sum * 8e-6;
  if (sent) measure(came - *sent, came);
  if (came - *first_ >= seconds(1)) decide(came);
}

/// Packets that waited one after the other: the link is full. As long as none waits, a measured
/// limit is given up little by little, as the link may carry more again.
void LinkBudget::measure(Duration delay, TimePoint came) {
  constexpr Duration kRemembered = seconds(10), kWaited = milliseconds(60),
                     kQuick = milliseconds(20);
  constexpr int kInARow = 3;
  constexpr double kOfReceived = 0.9, kGrowth_per_s = 0.05, kFree = 3;
  while (!delays_.empty() && delays_.back().delay >= delay) delays_.pop_back();
  delays_.push_back({came, delay});
  while (came - delays_.front().came > kRemembered) delays_.pop_front();
  const Duration waited = delay - delays_.front().delay;
  late_ = waited > kWaited ? late_ + 1 : 0;
  if (late_ >= kInARow && came - *first_ >= seconds(1)) {
    lower(kOfReceived * mbps_, came);
  } else if (measured_mbps_ && waited < kQuick && limit_changed_) {
    const double s = std::chrono::duration<double>(came - *limit_changed_).count();
    *measured_mbps_ *= std::exp(kGrowth_per_s * std::clamp(s, 0.0, 1.0));
    if (*measured_mbps_ > kFree * mbps_ && coarser_ == 0) measured_mbps_.reset();
  }
  limit_changed_ = came;
}

/// What comes after the first measurement is what was asked for, which tells nothing of the link:
/// only where packets still wait after a while is the limit lower.
void LinkBudget::lower(double mbps, TimePoint now) {
  constexpr Duration kWait = seconds(2);
  constexpr double kStep = 0.8;
  if (measured_mbps_ && now - *lowered_ < kWait) return;
  measured_mbps_ = measured_mbps_ ? std::max(mbps, kStep * *measured_mbps_) : mbps;
  lowered_ = now;
}

/// What was asked for takes a while to arrive, so decisions are some captures apart.
void LinkBudget::decide(TimePoint now) {
  constexpr Duration kCoarserEvery = milliseconds(400), kFinerEvery = seconds(1);
  constexpr double kMost = 0.95, kAim = 0.9, kAmple = 0.75;
  const auto limit = limit_mbps();
  if (!decided_) decided_ = now;
  if (limit && mbps_ > kMost * *limit && now - *decided_ >= kCoarserEvery) {
    coarser_ += static_cast<int>(std::ceil(std::log(mbps_ / (kAim * *limit)) / kPerQp));
    decided_ = now;
  } else if ((!limit || mbps_ < kAmple * *limit) && now - *decided_ >= kFinerEvery) {
    --coarser_;
    decided_ = now;
  }
  coarser_ = std::clamp(coarser_, 0, kCoarsest);
}

}  // namespace mr::rate
