#pragma once

namespace mr::merge {

/// Options of merging the surfaces of a merger's inputs.
struct MergeConfig {
  enum class Owner { paper, coherent } owner = Owner::coherent;
  enum class Overlap { rays, raster } overlap = Overlap::raster;
  bool refine = false;
  bool color_gain = false;
  double calibration_error_m = 0.005;  ///< how far two sensors may disagree, 1 sigma
  double island_area_m2 = 0;           ///< smaller components are removed; 0: by voxel size
  double gap_m = 0;                    ///< wider gaps between sensors stay open; 0: 2.5 voxels
  double leave_out_mm = 0;  ///< a sensor whose residual to its neighbours is larger is excluded;
                            ///< 0: it is only reported
  friend bool operator==(const MergeConfig&, const MergeConfig&) = default;
};

}  // namespace mr::merge
