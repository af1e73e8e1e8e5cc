#pragma once

#include <algorithm>

#include "mr/node/allowance.h"

namespace mr::node {

/// Paces a sensor's still surface into a link whose limit is known. It gets what picture and moving
/// surface leave of nine tenths of the link, and at least a tenth of the link. What is not used
/// while some waits, since chunks come in one piece, is kept: up to half a second's worth. Time is
/// counted in captures.
class LinkPace {
 public:
  /// Both above 0.
  LinkPace(double limit_mbps, double fps)
      : share_(limit_mbps * 1e6 / 8 / fps), most_(kMost_s * fps * share_) {}

  /// Of the next capture, whose rest is taken to be like the last one's.
  Allowance next(bool some_waits) {
    if (!some_waits) saved_ = std::min(saved_, 0.0);
    saved_ = std::min(saved_ + std::max(kOfLink * share_ - others_, kLeast * share_), most_);
    return {std::max(saved_, 0.0), saved_ >= most_};
  }
  /// The capture's packet took `all` bytes, its still surface `still` of them.
  void sent(double all, double still) { saved_ -= still, others_ = std::max(all - still, 0.0); }

 private:
  static constexpr double kOfLink = 0.9, kLeast = 0.1, kMost_s = 0.5;

  double share_, most_;  ///< bytes: of a capture; that are kept
  double saved_ = 0, others_ = 0;
};

}  // namespace mr::node
