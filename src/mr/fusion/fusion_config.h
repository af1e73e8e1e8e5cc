#pragma once

#include <string>
#include <vector>

#include "mr/core/range.h"

namespace mr::fusion {

enum class Decomposition { none, chunks, patches };

/// Filtering of a sensor's depth before fusion (fusion/clean_depth.h). In a scene file these are
/// keys of `fusion`.
struct CleanConfig {
  bool mixed_pixels = true;  ///< remove mixed (flying) pixels at depth edges
  int speckle_px = 8;        ///< remove regions of fewer pixels; 0 or 1: off
  int fill_px = 2;           ///< fill gaps of at most this many pixels inside a surface; 0: off
  bool smooth_depth = true;  ///< bilateral filter against sensor noise

  static constexpr Range kSpeckle_px{0, 1'000'000}, kFill_px{0, 7};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    return out_of_range({{"speckle_px", speckle_px, kSpeckle_px}, {"fill_px", fill_px, kFill_px}});
  }
  friend bool operator==(const CleanConfig&, const CleanConfig&) = default;
};

struct FusionConfig {
  Decomposition decomposition = Decomposition::chunks;
  double chunk_m = 1.28;             ///< edge of the scene's chunk grid
  int patches_x = 4, patches_y = 4;  ///< the paper's M×N
  double truncation_m = 0.038;       ///< half width of the signed-distance band
  CleanConfig clean;                 ///< keys smooth_depth, mixed_pixels, speckle_px, fill_px

  static constexpr Range kChunk_m{0, 100, true}, kTruncation_m{0, 1, true}, kPatches{1, 16};
  static constexpr int kLeastChunkVoxels = 8, kLeastTruncationVoxels = 2;
  static constexpr double kTruncation_voxels = 3.8;  ///< the default (docs/fusion.md)
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const;
  /// The same; also checks that chunks and the band span enough voxels of this edge.
  std::vector<std::string> problems(double voxel_m) const;
  friend bool operator==(const FusionConfig&, const FusionConfig&) = default;
};

}  // namespace mr::fusion
