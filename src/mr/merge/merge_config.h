#pragma once

namespace mr::merge {

/// How the surfaces of a merger's inputs become one.
struct MergeConfig {
  enum class Owner { paper, coherent } owner = Owner::coherent;
  enum class Overlap { rays, raster } overlap = Overlap::raster;
  bool refine = false;
  bool color_gain = false;
  double calibration_error_m = 0.005;  ///< how far two sensors may disagree, 1 sigma
  double island_area_m2 = 0;           ///< smaller components go; 0: what suits the voxel
  double gap_m = 0;                    ///< wider gaps between sensors stay open; 0: 2.5 voxels
  double leave_out_mm = 0;  ///< a sensor whose surface lies farther than this from its neighbours'
                            ///< is left out; 0: it is told, and stays
  friend bool operator==(const MergeConfig&, const MergeConfig&) = default;
};

}  // namespace mr::merge
