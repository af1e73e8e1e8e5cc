#pragma once

#include <memory>
#include <string>
#include <vector>

#include "mr/core/mesh.h"
#include "stage.h"

namespace mr::bench {

/// A mesh to decimate, and to how many triangles.
struct SimplifyCase {
  std::string name;  ///< "10%" of the default input, "kitchen/10%" of another
  std::string input;
  std::shared_ptr<const Mesh> mesh;  ///< without runs, which peers know nothing of
  std::size_t triangles = 0;
};

/// The stage's own cases: 50, 25, 10 and 5 % of frames fused as fuse_ours() does it, and of a
/// merged surface. The default input is room_bench, or the synthetic rig where that is missing.
std::vector<CaseInfo> simplify_cases();

/// Those cases that the request names: the stage's own, or of every sensor's first frame of a scene
/// ("cam-0/10%").
Result<std::vector<SimplifyCase>> load_simplify_cases(const Request& request,
                                                      cli::ProgressBar& bar);

}  // namespace mr::bench
