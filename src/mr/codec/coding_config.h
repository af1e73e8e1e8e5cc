#pragma once

#include <string>
#include <vector>

#include "mr/core/coding_plan.h"
#include "mr/core/range.h"

namespace mr::codec {

struct CodingConfig {
  double texture_scale = 1;
  int texture_qp = 28;
  int sensor_texture_qp = 22;  ///< between sensor and first merger
  int depth_qp = 14;           ///< of the depth video, pipeline rgbd only
  int frame_divider = 1;       ///< baselines only: every n-th capture is sent

  static constexpr Range kTextureScale = CodingPlan::kTextureScale, kQp{0, 51},
                         kFrameDivider{1, 30};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    return out_of_range({{"texture_scale", texture_scale, kTextureScale},
                         {"texture_qp", texture_qp, kQp},
                         {"sensor_texture_qp", sensor_texture_qp, kQp},
                         {"depth_qp", depth_qp, kQp},
                         {"frame_divider", frame_divider, kFrameDivider}});
  }
  friend bool operator==(const CodingConfig&, const CodingConfig&) = default;
};

}  // namespace mr::codec
