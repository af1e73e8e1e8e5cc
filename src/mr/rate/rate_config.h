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
  /// Of the quality of what moves in what our model looks for; the rest is of the whole picture.
  double moving_weight = 0.5;

  static constexpr Range kTarget_mbps{0, 1e5, true};
  static constexpr Range kRungs{1, kMostRungs}, kMovingWeight{0, 1};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    return out_of_range({{"target_mbps", target_mbps, kTarget_mbps},
                         {"rungs", rungs, kRungs},
                         {"moving_weight", moving_weight, kMovingWeight}});
  }
  friend bool operator==(const RateConfig&, const RateConfig&) = default;
};

}  // namespace mr::rate
