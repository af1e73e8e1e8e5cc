#pragma once

namespace mr::codec {

struct CodingConfig {
  double texture_scale = 1;
  int texture_qp = 28;
  int sensor_texture_qp = 22;  ///< between sensor and first merger
  int depth_qp = 14;           ///< pipeline rgbd: of its depth video
  int frame_divider = 1;       ///< baselines: every n-th capture is sent
  friend bool operator==(const CodingConfig&, const CodingConfig&) = default;
};

}  // namespace mr::codec
