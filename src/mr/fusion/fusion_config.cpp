#include "mr/fusion/fusion_config.h"

#include <initializer_list>

namespace mr::fusion {

std::vector<std::string> FusionConfig::problems() const {
  std::vector<std::string> out = out_of_range({{"chunk_m", chunk_m, kChunk_m},
                                               {"truncation_m", truncation_m, kTruncation_m},
                                               {"patches", patches_x, kPatches},
                                               {"patches", patches_y, kPatches}});
  append(out, clean.problems());
  return out;
}

std::vector<std::string> FusionConfig::problems(double voxel_m) const {
  constexpr double kRounding = 1e-9;
  std::vector<std::string> out = problems();
  const auto check = [&](const char* name, double length_m, int least) {
    if (length_m < least * voxel_m - kRounding)
      out.push_back(std::string(name) + " must be at least " + std::to_string(least) +
                    " voxels of voxel_m");
  };
  check("chunk_m", chunk_m, kLeastChunkVoxels);
  check("truncation_m", truncation_m, kLeastTruncationVoxels);
  return out;
}

}  // namespace mr::fusion
