#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mr/core/range.h"
#include "mr/rate/ladder.h"

namespace mr::rate {

struct RateConfig {
  enum class Model { fixed, lookup, classifier, ours } model = Model::fixed;
  double target_mbps = 20;           ///< of what the root sends to viewers
  std::filesystem::path model_file;  ///< from `meshreduce train`; empty: the program's own models

  int rungs = kMostRungs;  ///< streams of different rates for viewers, at most

  static constexpr Range kTarget_mbps{0, 1e5, true};
  static constexpr Range kRungs{1, kMostRungs};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    return out_of_range({{"target_mbps", target_mbps, kTarget_mbps}, {"rungs", rungs, kRungs}});
  }
  friend bool operator==(const RateConfig&, const RateConfig&) = default;
};

}  // namespace mr::rate
