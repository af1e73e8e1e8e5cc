#include "mr/rate/time_budget.h"

#include <algorithm>

namespace mr::rate {

void TimeBudget::note(double ms, double error_voxels) {
  constexpr int kDecideEvery = 15;  // captures
  sum_ms_ += ms;
  if (++captures_ < kDecideEvery) return;
  const double mean_ms = sum_ms_ / captures_;
  sum_ms_ = 0, captures_ = 0;
  decide(mean_ms, error_voxels);
}

void TimeBudget::decide(double mean_ms, double error_voxels) {
  constexpr double kFirst_voxels = 0.7;
  constexpr double kRaise = 1.4, kLower = 1.2;
  constexpr double kHelps = 0.9;  // of the time before
  constexpr double kAmple = 0.7;  // of the budget
  constexpr int kWait = 20;       // decisions, after a raise that did not help
  if (is_tried_) {
    is_tried_ = false;
    if (mean_ms > kHelps * ms_before_) {
      least_voxels_ = voxels_before_, wait_ = kWait;
      return;
    }
  }
  if (wait_ > 0) --wait_;
  const double now_voxels = std::max(least_voxels_, error_voxels);
  if (mean_ms > kMost_ms && wait_ == 0 && now_voxels < most_voxels_) {
    is_tried_ = true, voxels_before_ = least_voxels_, ms_before_ = mean_ms;
    least_voxels_ = std::min(std::max(now_voxels * kRaise, kFirst_voxels), most_voxels_);
  } else if (mean_ms < kAmple * kMost_ms && least_voxels_ > 0) {
    least_voxels_ /= kLower;
    if (least_voxels_ < kFirst_voxels) least_voxels_ = 0;
  }
}

}  // namespace mr::rate
