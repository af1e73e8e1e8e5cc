#pragma once

#include <string>
#include <vector>

#include "mr/atlas/labels.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/view.h"
#include "stage.h"

namespace mr::bench {

/// A surface to be labelled and the views that see it.
struct AtlasCase {
  std::string name;
  Mesh surface;                    ///< to be labelled
  Mesh still;                      ///< kept, and hides the other one; empty: there is none
  std::vector<View> views;         ///< four, 1280x720
  std::vector<ImageRgb> pictures;  ///< [views]
  double voxel_m = 0.01, error_m = 0.01;
};

/// Four views of a furnished synthetic office with three people, of 200,000 triangles: `full`, all
/// of it anew; `moving`, the people alone before the still room, as in a running scene.
std::vector<CaseInfo> atlas_cases();

/// A case by name. The rig's rendered pictures are cached.
Result<AtlasCase> load_atlas_case(const std::string& name);

}  // namespace mr::bench
