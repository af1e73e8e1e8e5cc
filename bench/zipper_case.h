#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/merge/seam/point_grid.h"
#include "stage.h"

namespace mr::bench {

/// Points on the borders of several parts, and the parts' numbers.
struct BorderPoints {
  std::string name;
  std::vector<Vec3f> points;
  std::vector<std::uint32_t> part;
  float radius_m = 0.02f;
};

/// Parts after overlap removal, to be joined.
struct Strips {
  std::string name;
  std::vector<Mesh> parts;
  double voxel_m = 0.01;
};

/// What was loaded for a case: one of both.
struct ZipperCase {
  BorderPoints border;
  Strips strips;
};

/// "10k" and "100k": border vertices of the four room_bench parts. "strips/CASE": the cases of the
/// merge stage with one surface per sensor.
std::vector<CaseInfo> zipper_cases();
Result<ZipperCase> load_zipper_case(const std::string& name);

/// What matching finds, for each point: see PointGrid::match().
using Matches = std::vector<merge::PointGrid::Match>;

}  // namespace mr::bench
