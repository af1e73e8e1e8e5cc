#include "mr/fusion/voxel_volume.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <tuple>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"

namespace mr::fusion {
namespace {

constexpr std::uint32_t kEmptySlot = 0xFFFFFFFFu;
constexpr int kSide = VoxelBlock::kSide;

/// The order of blocks in a volume.
bool in_order(Vec3i a, Vec3i b) { return std::tie(a.z, a.y, a.x) < std::tie(b.z, b.y, b.x); }

/// What a pixel of a row looks along, in the world and per metre of depth.
class RowOfRays {
 public:
  RowOfRays(const Camera& camera, const Pose& T_world_camera, int y)
      : first_(T_world_camera.rotation * unproject(camera, {0, static_cast<double>(y)})),
        step_(T_world_camera.rotation.column(0) / camera.fx) {}
  Vec3d at(int x) const { return first_ + step_ * x; }

 private:
  Vec3d first_, step_;
};

/// Depth without the pixels whose point lies outside the box.
ImageDepth inside(const Box3d& box, const ImageDepth& depth, const Camera& camera,
                  const Pose& T_world_camera) {
  ImageDepth out = depth;
  parallel_for(depth.height, 32, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      const RowOfRays rays(camera, T_world_camera, y);
      for (int x = 0; x < depth.width; ++x) {
        float& d = *out.at(x, y);
        if (!box.contains(T_world_camera.translation + rays.at(x) * d)) d = 0;
      }
    }
  });
  return out;
}

// --- which blocks a frame touches

/// Collects block coordinates and drops most that it has met lately.
class BlockCollector {
 public:
  BlockCollector() { recent_.fill({INT32_MAX, 0, 0}); }
  void add(Vec3i block) {
    const std::uint32_t mixed = static_cast<std::uint32_t>(block.x) * 1u +
                                static_cast<std::uint32_t>(block.y) * 61u +
                                static_cast<std::uint32_t>(block.z) * 3571u;
    Vec3i& slot = recent_[mixed % recent_.size()];
    if (slot == block) return;
    slot = block;
    met_.push_back(block);
  }
  const std::vector<Vec3i>& met() const { return met_; }

 private:
  std::array<Vec3i, 1024> recent_;
  std::vector<Vec3i> met_;
};

/// The surface lies within a voxel of the depth pixels; what is farther off need not be stored.
constexpr double kStoredBand = 3;  // voxels

/// Adds the blocks within the stored part of the truncation band around the pixels of a row.
void collect_row(const ImageDepth& depth, const RowOfRays& rays, Vec3d eye,
                 const VolumeConfig& config, const Rect& region, int y, BlockCollector& blocks) {
  const double per_block = 1 / (config.voxel_m * kSide);
  const double step = config.voxel_m * kSide / 2;
  const double band = std::min(config.truncation_m, kStoredBand * config.voxel_m);
  const auto floor_of = [](double v) {
    v = std::clamp(v, -1e9, 1e9);
    const auto i = static_cast<std::int32_t>(v);
    return i - (i > v);
  };
  for (int x = region.x; x < region.x + region.width; ++x) {
    const double d = *depth.at(x, y);
    if (d <= 0) continue;
    const Vec3d ray = rays.at(x) * per_block;
    const double far = d + band;
    for (double z = d - band;; z = std::min(z + step, far)) {
      const Vec3d p = eye * per_block + ray * z;
      blocks.add({floor_of(p.x), floor_of(p.y), floor_of(p.z)});
      if (z >= far) break;
    }
  }
}

/// Each once, in order.
std::vector<Vec3i> touched_blocks(const ImageDepth& depth, const Camera& camera,
                                  const Pose& T_world_camera, const VolumeConfig& config,
                                  const Rect& region) {
  constexpr int kRows = 64;
  const int bands = (region.height + kRows - 1) / kRows;
  std::vector<std::vector<Vec3i>> of_band(bands);
  parallel_for(of_band.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      BlockCollector blocks;
      const int first = region.y + static_cast<int>(b) * kRows;
      for (int y = first; y < std::min(first + kRows, region.y + region.height); ++y)
        collect_row(depth, RowOfRays(camera, T_world_camera, y), T_world_camera.translation, config,
                    region, y, blocks);
      of_band[b] = blocks.met();
    }
  });
  std::vector<Vec3i> all;
  for (const auto& blocks : of_band) all.insert(all.end(), blocks.begin(), blocks.end());
  std::sort(all.begin(), all.end(), in_order);
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

// --- averaging a frame in

/// Four numbers at once, on any CPU (an extension that g++ and clang share).
using Float4 [[gnu::vector_size(16)]] = float;
using Int4 [[gnu::vector_size(16)]] = std::int32_t;

Float4 load(const float* from) {
  Float4 v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
void store(Float4 v, float* to) { std::memcpy(to, &v, sizeof v); }

/// What integrating voxels needs to know of the frame.
struct FrameView {
  FrameView(const ImageDepth& d, const Camera& c, const Pose& T_world_camera,
            const VolumeConfig& config, const Rect& region)
      : depth(d),
        T_camera_world(T_world_camera.inverse()),
        voxel_m(config.voxel_m),
        truncation_m(static_cast<float>(config.truncation_m)),
        fx(static_cast<float>(c.fx)),
        fy(static_cast<float>(c.fy)),
        cx(static_cast<float>(c.cx + 0.5)),
        cy(static_cast<float>(c.cy + 0.5)),
        left(static_cast<float>(region.x)),
        top(static_cast<float>(region.y)),
        right(static_cast<float>(region.x + region.width)),
        bottom(static_cast<float>(region.y + region.height)) {
    for (int axis = 0; axis < 3; ++axis)
      step[axis] = vec_cast<float>(T_camera_world.rotation.column(axis) * voxel_m);
  }

  const ImageDepth& depth;
  Pose T_camera_world;
  double voxel_m;
  std::array<Vec3f, 3> step;  ///< from voxel to voxel along x, y, z, in the camera
  float truncation_m;
  float fx, fy, cx, cy;            ///< cx, cy: of pixel corners, so that rounding is cutting off
  float left, top, right, bottom;  ///< pixels in use
};

/// The depth that four voxel centres are compared with; 0 where nothing was measured.
Float4 measured_depth(const FrameView& f, Float4 x, Float4 y, Float4 z) {
  const Float4 per_z = 1.0f / z;
  const Float4 u = f.fx * x * per_z + f.cx, v = f.fy * y * per_z + f.cy;
  const Int4 in_picture =
      (z > 0.0f) & (u >= f.left) & (u < f.right) & (v >= f.top) & (v < f.bottom);
  const Int4 column = __builtin_convertvector(in_picture ? u : Float4{}, Int4),
             row = __builtin_convertvector(in_picture ? v : Float4{}, Int4);
  const Int4 pixel = row * f.depth.width + column;
  const float* const d = f.depth.data.data();
  return in_picture ? Float4{d[pixel[0]], d[pixel[1]], d[pixel[2]], d[pixel[3]]} : Float4{};
}

/// Averages the frame into four voxels, the first of them at `p_camera`. Returns bit i for voxel i
/// seen, bit 8 + i inside, bit 16 + i near (see VoxelBlock).
std::int32_t integrate_four(const FrameView& f, Vec3f p_camera, float* distance, float* weight) {
  constexpr Float4 kSteps{0, 1, 2, 3};
  const Float4 z = p_camera.z + f.step[0].z * kSteps;
  const Float4 depth =
      measured_depth(f, p_camera.x + f.step[0].x * kSteps, p_camera.y + f.step[0].y * kSteps, z);
  const Float4 in_front = depth - z;
  const Int4 used = (depth > 0.0f) & (in_front >= -f.truncation_m);
  const Float4 value = in_front / f.truncation_m, old_weight = load(weight);
  const Float4 limited = value < 1.0f ? value : Float4{} + 1.0f;
  const Float4 mean = (load(distance) * old_weight + limited) / (old_weight + 1.0f);
  const Float4 new_distance = used ? mean : load(distance);
  const Float4 new_weight = used ? old_weight + 1.0f : old_weight;
  store(new_distance, distance);
  store(new_weight, weight);
  const Int4 seen = new_weight > 0.0f;
  const Int4 bits = seen & (Int4{1, 2, 4, 8} | ((new_distance < 0.0f) & (Int4{1, 2, 4, 8} << 8)) |
                            ((new_distance < 1.0f) & (Int4{1, 2, 4, 8} << 16)));
  return bits[0] | bits[1] | bits[2] | bits[3];
}

void integrate_block(VoxelBlock& block, const FrameView& f) {
  const Vec3d first = vec_cast<double>(block.coordinate * kSide) * f.voxel_m;
  const Vec3f corner = vec_cast<float>(f.T_camera_world * first);
  for (int z = 0; z < kSide; ++z) {
    std::uint64_t seen = 0, inside = 0, near = 0;
    for (int y = 0; y < kSide; ++y) {
      const Vec3f p =
          corner + f.step[1] * static_cast<float>(y) + f.step[2] * static_cast<float>(z);
      float* const distance = &block.distance[(z * kSide + y) * kSide];
      float* const weight = &block.weight[(z * kSide + y) * kSide];
      const auto bits = static_cast<std::uint64_t>(
          integrate_four(f, p, distance, weight) |
          integrate_four(f, p + f.step[0] * 4.0f, distance + 4, weight + 4) << 4);
      seen |= (bits & 0xFF) << 8 * y;
      inside |= (bits >> 8 & 0xFF) << 8 * y;
      near |= (bits >> 16) << 8 * y;
    }
    block.seen[z] = seen, block.inside[z] = inside, block.near[z] = near;
  }
}

}  // namespace

VoxelVolume::VoxelVolume(const VolumeConfig& config) : config_(config) {
  MR_ASSERT(config.voxel_m > 0 && config.truncation_m >= config.voxel_m);
  rebuild_directory();
}

std::optional<std::uint32_t> VoxelVolume::find(Vec3i c) const {
  const std::size_t mask = directory_.size() - 1;
  for (std::size_t slot = hash_cell(c) & mask; directory_[slot] != kEmptySlot;
       slot = (slot + 1) & mask)
    if (blocks_[directory_[slot]].coordinate == c) return directory_[slot];
  return std::nullopt;
}

void VoxelVolume::rebuild_directory() {
  directory_.assign(std::bit_ceil(std::max<std::size_t>(1024, 2 * blocks_.size())), kEmptySlot);
  const std::size_t mask = directory_.size() - 1;
  for (std::uint32_t b = 0; b < blocks_.size(); ++b) {
    std::size_t slot = hash_cell(blocks_[b].coordinate) & mask;
    while (directory_[slot] != kEmptySlot) slot = (slot + 1) & mask;
    directory_[slot] = b;
  }
}

void VoxelVolume::add_blocks(const std::vector<Vec3i>& sorted_coordinates) {
  const std::size_t before = blocks_.size();
  blocks_.reserve(before + sorted_coordinates.size());
  for (const Vec3i c : sorted_coordinates)
    if (before == 0 || !find(c)) blocks_.emplace_back().coordinate = c;
  if (before > 0 && blocks_.size() > before)
    std::sort(blocks_.begin(), blocks_.end(), [](const VoxelBlock& a, const VoxelBlock& b) {
      return in_order(a.coordinate, b.coordinate);
    });
  rebuild_directory();
}

void VoxelVolume::integrate(const ImageDepth& all_depth, const Camera& camera,
                            const Pose& T_world_camera, const Rect& region) {
  MR_ASSERT(camera.model == CameraModel::pinhole && camera.distortion == DistortionModel::none);
  MR_ASSERT(all_depth.width == camera.width && all_depth.height == camera.height);
  const ImageDepth depth =
      config_.bounds ? inside(*config_.bounds, all_depth, camera, T_world_camera) : all_depth;
  add_blocks(touched_blocks(depth, camera, T_world_camera, config_, region));
  const FrameView view(depth, camera, T_world_camera, config_, region);
  parallel_for(blocks_.size(), 32, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) integrate_block(blocks_[b], view);
  });
}

std::size_t VoxelVolume::memory_bytes() const {
  return blocks_.capacity() * sizeof(VoxelBlock) + directory_.capacity() * sizeof(std::uint32_t);
}

}  // namespace mr::fusion
