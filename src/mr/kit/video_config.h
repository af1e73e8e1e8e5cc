#pragma once

namespace mr::kit {

struct VideoConfig {
  int threads = 2, slices = 2;  ///< libx264's bytes follow them
  friend bool operator==(const VideoConfig&, const VideoConfig&) = default;
};

}  // namespace mr::kit
