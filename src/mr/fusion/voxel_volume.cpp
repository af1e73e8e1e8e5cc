#include "mr/fusion/voxel_volume.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"

namespace mr::fusion {
namespace {

constexpr std::uint32_t kEmptySlot = 0xFFFFFFFFu;

Vec3i block_of(Vec3d p_world, double block_m) {
  return {static_cast<std::int32_t>(std::floor(p_world.x / block_m)),
          static_cast<std::int32_t>(std::floor(p_world.y / block_m)),
          static_cast<std::int32_t>(std::floor(p_world.z / block_m))};
}

/// What integrating one block needs to know of the frame.
struct FrameView {
  const ImageDepth& depth;
  const Camera& camera;
  Pose T_camera_world;
  Rect region;
};

/// The depth that voxel centre `p_camera` is compared with; 0 where nothing was measured.
float measured_depth(const FrameView& f, Vec3d p_camera) {
  const double u = f.camera.fx * p_camera.x / p_camera.z + f.camera.cx;
  const double v = f.camera.fy * p_camera.y / p_camera.z + f.camera.cy;
  const Rect& r = f.region;
  const double x = std::floor(u + 0.5), y = std::floor(v + 0.5);
  if (!(x >= r.x && y >= r.y && x < r.x + r.width && y < r.y + r.height)) return 0;
  return *f.depth.at(static_cast<int>(x), static_cast<int>(y));
}

void integrate_block(VoxelBlock& block, const FrameView& f, const VolumeConfig& config) {
  const Vec3d step_x = f.T_camera_world.rotation.column(0) * config.voxel_m;
  for (int z = 0; z < VoxelBlock::kSide; ++z)
    for (int y = 0; y < VoxelBlock::kSide; ++y) {
      const Vec3i first =
          Vec3i{block.coordinate.x * 8, block.coordinate.y * 8 + y, block.coordinate.z * 8 + z};
      Vec3d p = f.T_camera_world * (vec_cast<double>(first) * config.voxel_m);
      for (int x = 0; x < VoxelBlock::kSide; ++x, p += step_x) {
        if (p.z <= 0) continue;
        const float depth = measured_depth(f, p);
        if (depth <= 0) continue;
        const double signed_distance = depth - p.z;
        if (signed_distance < -config.truncation_m) continue;
        const float value =
            static_cast<float>(std::min(1.0, signed_distance / config.truncation_m));
        const int i = (z * 8 + y) * 8 + x;
        const float weight = block.weight[i];
        block.distance[i] = (block.distance[i] * weight + value) / (weight + 1);
        block.weight[i] = weight + 1;
      }
    }
}

/// Depth without the pixels whose point lies outside the box.
ImageDepth inside(const Box3d& box, const ImageDepth& depth, const Camera& camera,
                  const Pose& T_world_camera) {
  ImageDepth out = depth;
  parallel_for(depth.height, 32, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < depth.width; ++x) {
        const Vec3d ray = unproject(camera, {static_cast<double>(x), static_cast<double>(y)});
        const double d = *depth.at(x, y);
        if (d > 0 && !box.contains(T_world_camera * (ray * d))) *out.at(x, y) = 0;
      }
  });
  return out;
}

}  // namespace

VoxelVolume::VoxelVolume(const VolumeConfig& config) : config_(config) {
  MR_ASSERT(config.voxel_m > 0 && config.truncation_m >= config.voxel_m);
  rebuild_directory(1024);
}

std::optional<std::uint32_t> VoxelVolume::find(Vec3i c) const {
  const std::size_t mask = directory_.size() - 1;
  for (std::size_t slot = hash_cell(c) & mask; directory_[slot] != kEmptySlot;
       slot = (slot + 1) & mask)
    if (blocks_[directory_[slot]].coordinate == c) return directory_[slot];
  return std::nullopt;
}

void VoxelVolume::rebuild_directory(std::size_t slots) {
  directory_.assign(slots, kEmptySlot);
  const std::size_t mask = slots - 1;
  for (std::uint32_t b = 0; b < blocks_.size(); ++b) {
    std::size_t slot = hash_cell(blocks_[b].coordinate) & mask;
    while (directory_[slot] != kEmptySlot) slot = (slot + 1) & mask;
    directory_[slot] = b;
  }
}

void VoxelVolume::insert(Vec3i c) {
  if (find(c)) return;
  VoxelBlock& block = blocks_.emplace_back();
  block.coordinate = c;
  block.distance.fill(1);
  if (blocks_.size() * 2 > directory_.size()) return rebuild_directory(directory_.size() * 2);
  const std::size_t mask = directory_.size() - 1;
  std::size_t slot = hash_cell(c) & mask;
  while (directory_[slot] != kEmptySlot) slot = (slot + 1) & mask;
  directory_[slot] = static_cast<std::uint32_t>(blocks_.size() - 1);
}

void VoxelVolume::sort_blocks() {
  std::vector<std::uint32_t> order(blocks_.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const Vec3i p = blocks_[a].coordinate, q = blocks_[b].coordinate;
    return std::tie(p.z, p.y, p.x) < std::tie(q.z, q.y, q.x);
  });
  std::vector<VoxelBlock> sorted;
  sorted.reserve(blocks_.size());
  for (const std::uint32_t b : order) sorted.push_back(blocks_[b]);
  blocks_ = std::move(sorted);
}

void VoxelVolume::allocate(const ImageDepth& depth, const Camera& camera,
                           const Pose& T_world_camera, const Rect& region) {
  const double block_m = config_.voxel_m * VoxelBlock::kSide;
  const double step = block_m / 2;
  for (int y = region.y; y < region.y + region.height; ++y)
    for (int x = region.x; x < region.x + region.width; ++x) {
      const double d = *depth.at(x, y);
      if (d <= 0) continue;
      const Vec3d ray = unproject(camera, {static_cast<double>(x), static_cast<double>(y)});
      Vec3i last{INT32_MAX, 0, 0};
      const double far = d + config_.truncation_m;
      for (double z = d - config_.truncation_m;; z = std::min(z + step, far)) {
        const Vec3i block = block_of(T_world_camera * (ray * z), block_m);
        if (block != last) insert(block);
        last = block;
        if (z >= far) break;
      }
    }
  sort_blocks();
  rebuild_directory(directory_.size());
}

void VoxelVolume::integrate(const ImageDepth& all_depth, const Camera& camera,
                            const Pose& T_world_camera, const Rect& region) {
  MR_ASSERT(camera.model == CameraModel::pinhole && camera.distortion == DistortionModel::none);
  MR_ASSERT(all_depth.width == camera.width && all_depth.height == camera.height);
  const ImageDepth depth =
      config_.bounds ? inside(*config_.bounds, all_depth, camera, T_world_camera) : all_depth;
  allocate(depth, camera, T_world_camera, region);
  const FrameView view{depth, camera, T_world_camera.inverse(), region};
  parallel_for(blocks_.size(), 32, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) integrate_block(blocks_[b], view, config_);
  });
}

std::size_t VoxelVolume::memory_bytes() const {
  return blocks_.capacity() * sizeof(VoxelBlock) + directory_.capacity() * sizeof(std::uint32_t);
}

}  // namespace mr::fusion
