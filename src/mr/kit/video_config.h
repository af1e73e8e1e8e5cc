#pragma once

#include <string>
#include <vector>

#include "mr/core/range.h"

namespace mr::kit {

struct VideoConfig {
  int threads = 2, slices = 2;  ///< libx264's bytes follow them

  static constexpr Range kThreads{1, 64}, kSlices{1, 64};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    return out_of_range({{"threads", threads, kThreads}, {"slices", slices, kSlices}});
  }
  friend bool operator==(const VideoConfig&, const VideoConfig&) = default;
};

}  // namespace mr::kit
