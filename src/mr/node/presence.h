#pragma once

#include <algorithm>
#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "mr/core/frame.h"

namespace mr::node {

/// Detects which of several sources are missing: those that deliver nothing new for too long. No
/// clock inside.
class Presence {
 public:
  /// A source is missing when it has delivered nothing new for this long; a slow source, for 2.5
  /// times its usual interval.
  static constexpr Duration kMissingAfter = std::chrono::milliseconds(1200);
  static constexpr Duration kSlowest = std::chrono::seconds(3);
  static constexpr std::size_t kGaps = 3;

  explicit Presence(std::size_t sources) : sources_(sources) {}

  /// Start of the observation: from then on sources that have never delivered count as missing.
  /// Without it the observation starts with the first delivery of any source.
  void begin(TimePoint at) { first_ = at; }

  /// The observer is busy for this long at a time, and the sources wait for it (back-pressure).
  void set_pace(Duration pace) { pace_ = pace; }

  /// A source delivered a capture; the same capture again is nothing new.
  void seen(std::size_t source, TimePoint captured_at, TimePoint now) {
    Source& of = sources_[source];
    if (!first_) first_ = now;
    if (of.captured_at == captured_at) return;
    const Duration gap = of.at ? now - *of.at : Duration{};
    if (gap > Duration{} && gap <= kSlowest) {  // else the source was missing
      of.gaps.push_back(gap);
      if (of.gaps.size() > kGaps) of.gaps.pop_front();
    }
    of.captured_at = captured_at, of.at = now;
  }

  /// A source that has never delivered is measured from the start of the observation.
  bool is_missing(std::size_t source, TimePoint now) const {
    if (!first_) return false;
    const Source& of = sources_[source];
    const TimePoint last = of.at.value_or(*first_);
    // The smallest of a few intervals: a single delay does not make a source slow.
    const Duration usual =
        of.gaps.empty() ? Duration{} : *std::min_element(of.gaps.begin(), of.gaps.end());
    return now - last > std::max(kMissingAfter, std::max(usual, pace_) * 5 / 2);
  }
  std::vector<std::size_t> missing(TimePoint now) const {
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (is_missing(i, now)) out.push_back(i);
    return out;
  }

  struct Change {
    std::size_t source;
    bool is_missing;
  };
  /// The sources that went missing or came back since the last call.
  std::vector<Change> changes(TimePoint now) {
    std::vector<Change> out;
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (const bool missing = is_missing(i, now); missing != sources_[i].is_reported_missing) {
        sources_[i].is_reported_missing = missing;
        out.push_back({i, missing});
      }
    return out;
  }

 private:
  struct Source {
    std::optional<TimePoint> captured_at, at;
    std::deque<Duration> gaps;
    bool is_reported_missing = false;
  };
  std::vector<Source> sources_;
  std::optional<TimePoint> first_;
  Duration pace_{};
};

}  // namespace mr::node
