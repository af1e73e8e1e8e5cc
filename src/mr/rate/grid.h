#pragma once

#include <algorithm>
#include <cstddef>
#include <iterator>

#include "mr/rate/setting.h"

namespace mr::rate {

/// The grid of settings that every sweep measures and that models predict. Finer textures at a
/// smaller scale, and coarser ones at full scale, are never on a front.
struct TextureNode {
  double scale = 1;
  int qp = 28;
};
inline constexpr TextureNode kTextureNodes[] = {
    {1, 18},   {1, 23},   {1, 28},   {1, 33},   {1, 39},   {1, 45},  // by rising QP at each scale
    {0.7, 30}, {0.7, 38}, {0.7, 46}, {0.5, 34}, {0.5, 42}, {0.5, 50}};
inline constexpr double kErrorNodes_voxels[] = {0.5, 1, 2.5, 6};
inline constexpr int kPlateNodes_qp[] = {12, 20, 28, 36, 44};   // of the atlas of plates
inline constexpr int kBestPlateQp = 20, kCoarsestPlateQp = 44;  // of the usual plan; of all
inline constexpr double kStillNodes_voxels[] = {0.35, 1, 3};    // errors of the still surface
inline constexpr std::size_t kErrors = std::size(kErrorNodes_voxels),
                             kTextures = std::size(kTextureNodes);
/// The least quality of what moves: with more, limbs and heads are lost, which SSIM of whole
/// pictures hardly notices. Captures are left out before.
inline constexpr double coarsest_error_m(double voxel_m) { return std::max(0.04, voxel_m); }
inline constexpr double coarsest_error_voxels(double voxel_m) {
  return coarsest_error_m(voxel_m) / voxel_m;
}
inline constexpr int kBits = 10;                 ///< of the grid
inline constexpr int kLattices[] = {9, 10, 11};  ///< bits; of all settings

/// The scene file's usual plan: what is coded until a model decides.
inline constexpr Setting kUsualSetting{0.5, kBits, 1, 28};

}  // namespace mr::rate
