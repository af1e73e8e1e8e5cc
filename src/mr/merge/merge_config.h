#pragma once

#include <string>
#include <vector>

#include "mr/core/range.h"

namespace mr::merge {

/// Options of merging the surfaces of a merger's inputs.
struct MergeConfig {
  enum class Owner { paper, coherent } owner = Owner::coherent;
  enum class Overlap { rays, raster } overlap = Overlap::raster;
  bool refine = false;
  bool color_gain = true;
  double calibration_error_m = 0.005;  ///< how far two sensors may disagree, 1 sigma
  double island_area_m2 = 0;           ///< smaller components are removed; 0: by voxel size
  double gap_m = 0;                    ///< wider gaps between sensors stay open; 0: 2.5 voxels
  double agree_m = 0.05;    ///< sensors that disagree by less are bent towards each other; 0: none
  double fill_m = 0.05;     ///< narrower holes that nothing was seen through are closed; 0: none is
  double leave_out_mm = 0;  ///< a sensor whose residual to its neighbours is larger is excluded;
                            ///< 0: it is only reported

  static constexpr Range kCalibrationError_m{0, 0.5}, kIslandArea_m2{0, 100}, kGap_m{0, 1},
      kAgree_m{0, 0.5}, kFill_m{0, 0.5}, kLeaveOut_mm{0, 10'000};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    return out_of_range({{"calibration_error_m", calibration_error_m, kCalibrationError_m},
                         {"island_area_m2", island_area_m2, kIslandArea_m2},
                         {"gap_m", gap_m, kGap_m},
                         {"agree_m", agree_m, kAgree_m},
                         {"fill_m", fill_m, kFill_m},
                         {"leave_out_mm", leave_out_mm, kLeaveOut_mm}});
  }
  friend bool operator==(const MergeConfig&, const MergeConfig&) = default;
};

}  // namespace mr::merge
