#include "mr/fusion/voxel_volume.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/core/simd.h"
#include "mr/core/trace.h"
#include "mr/fusion/integrate_kernels.h"
#include "mr/fusion/pinhole_planes.h"
#include "mr/fusion/range_planes.h"

namespace mr::fusion {
namespace {

constexpr int kSide = VoxelBlock::kSide;
constexpr std::size_t kIntegratedAtOnce = 32;

/// Voxels computed around the surface: without history those that marching cubes reads, with
/// history those that the next frames' surface may need.
constexpr float kMargin = 1.05f, kMarginOfHistory = 3;

TileRule tile_rule(const VolumeConfig& config) {
  const float margin = config.history == History::none ? kMargin : kMarginOfHistory;
  const double block_m = kSide * config.voxel_m;
  return {margin / kSide, 1, static_cast<float>(std::min(config.truncation_m, block_m))};
}

/// The order of chunks and regions.
struct ByZyx {
  bool operator()(Vec3i a, Vec3i b) const {
    return std::tie(a.z, a.y, a.x) < std::tie(b.z, b.y, b.x);
  }
};

/// Lists of slots by chunk, in order of the chunks.
class Chunks {
 public:
  std::vector<std::uint32_t>& of(Vec3i cube) {
    if (last_ == nullptr || last_cube_ != cube) last_cube_ = cube, last_ = &lists_[cube];
    return *last_;
  }
  template <typename Use>
  void for_each(const Use& use) const {
    for (const auto& [cube, slots] : lists_) use(cube, slots);
  }

 private:
  std::map<Vec3i, std::vector<std::uint32_t>, ByZyx> lists_;
  Vec3i last_cube_;
  std::vector<std::uint32_t>* last_ = nullptr;
};

/// Whether a block may project into the picture (frustum test).
bool may_see(const FrameView& view, const VoxelBlock& block) {
  if (view.spherical) return true;
  constexpr double kHalf = (kSide - 1) / 2.0;
  const auto at = [&](int axis) { return block.coordinate[axis] * double{kSide} + kHalf; };
  const Vec3d p = view.origin + view.axis[0] * at(0) + view.axis[1] * at(1) + view.axis[2] * at(2);
  Vec3d reach;  // of (U, V, Z) inside the block
  for (const Vec3d a : view.axis)
    reach += Vec3d{std::abs(a.x), std::abs(a.y), std::abs(a.z)} * kHalf;
  // u >= 0 is U >= 0 where Z > 0, and u <= w is U <= w Z: linear, so the corners decide.
  const auto below_end = [&](double end, double v, double reach_v) {
    return v - reach_v <= end * (p.z + reach.z);
  };
  return p.z + reach.z > 0 && p.x + reach.x >= 0 && p.y + reach.y >= 0 &&
         below_end(view.width + 2, p.x, reach.x) && below_end(view.height + 2, p.y, reach.y);
}

}  // namespace

VoxelVolume::VoxelVolume(const VolumeConfig& config) : config_(config) {
  MR_ASSERT(config.voxel_m > 0 && config.truncation_m >= config.voxel_m && config.chunk_m >= 0);
  apply_simd_override();
}

void VoxelVolume::clear() {
  directory_.clear();
  order_.clear(), chunks_.clear();
  rows_.clear();
  slots_ = 0;
}

Vec3i VoxelVolume::chunk_of(Vec3i block) const {
  if (config_.chunk_m == 0) return {};
  const auto cube = [&](std::int32_t b) {
    return static_cast<std::int32_t>(
        std::floor((b + 0.5) * kSide * config_.voxel_m / config_.chunk_m));
  };
  return {cube(block.x), cube(block.y), cube(block.z)};
}

std::size_t VoxelVolume::memory_bytes() const {
  return slabs_.size() * sizeof(Slab) + weights_.size() * sizeof(WeightSlab) +
         directory_.memory_bytes() + order_.capacity() * sizeof(std::uint32_t) +
         rows_.capacity() * sizeof(std::uint64_t) + view_.depth.capacity() * sizeof(float) +
         view_.planes.capacity() * sizeof(RangePlane);
}

// --- allocation

/// The rows of voxels to allocate, for each horizontal band of the picture.
std::vector<std::vector<WantedRows>> VoxelVolume::wanted_rows(std::size_t& left_out_ranges) const {
  constexpr int kRowsAtOnce = 96;
  static_assert(kRowsAtOnce % kTile == 0);
  const TileRule rule = tile_rule(config_);
  std::vector<std::vector<WantedRows>> out((view_.height + kRowsAtOnce - 1) / kRowsAtOnce);
  std::vector<std::size_t> left_out(out.size());
  parallel_for(out.size(), 1, [&](std::size_t begin, std::size_t end) {
    std::vector<VoxelRange> ranges;
    for (std::size_t band = begin; band < end; ++band) {
      RowCollector collector(config_.most_blocks);
      const int first = static_cast<int>(band) * kRowsAtOnce;
      for (int y = first; y < std::min(first + kRowsAtOnce, view_.height);
           y += view_.spherical ? 1 : kTile) {
        ranges.clear();
        if (view_.spherical)
          plane_ranges(view_, y, rule.margin, ranges);
        else
          tile_ranges(view_, y / kTile, rule, ranges);
        for (const VoxelRange& range : ranges) collector.add(range);
      }
      left_out[band] = collector.left_out();
      out[band] = collector.take();
    }
  });
  for (const std::size_t count : left_out) left_out_ranges += count;
  return out;
}

std::uint32_t VoxelVolume::new_slot(Vec3i coordinate) {
  const auto slot = static_cast<std::uint32_t>(slots_++);
  if (slot == slabs_.size() * kSlab) slabs_.push_back(std::make_unique<Slab>());
  rows_.push_back(0);
  VoxelBlock& added = block(slot);
  added.coordinate = coordinate;
  added.seen = added.inside = added.near = {};
  if (config_.history == History::none) return slot;
  if (slot / kSlab == weights_.size()) weights_.push_back(std::make_unique<WeightSlab>());
  weights(slot).fill(0);
  return slot;
}

/// Assigns a slot to every wanted block. Returns the number of ranges and blocks above the limits.
std::size_t VoxelVolume::allocate() {
  std::fill(rows_.begin(), rows_.end(), 0);
  std::size_t left_out = 0;
  bool added = false;
  for (const auto& list : wanted_rows(left_out))
    for (const WantedRows& wanted : list) {
      const Vec3i at = view_.eye_block + wanted.block();
      if (slots_ >= config_.most_blocks && directory_.find(at) == BlockDirectory::kNone) {
        ++left_out;
        continue;
      }
      std::uint32_t& slot = directory_.at(at);
      if (slot == BlockDirectory::kNone) slot = new_slot(at), added = true;
      rows_[slot] |= wanted.rows;
    }
  if (added) sort_blocks();
  return left_out;
}

void VoxelVolume::sort_blocks() {
  const auto regions = directory_.regions();
  std::vector<std::uint32_t> sorted(regions.size());
  for (std::uint32_t i = 0; i < sorted.size(); ++i) sorted[i] = i;
  std::sort(sorted.begin(), sorted.end(), [&](std::uint32_t a, std::uint32_t b) {
    return ByZyx()(regions[a].coordinate, regions[b].coordinate);
  });
  Chunks chunks;
  for (const std::uint32_t r : sorted)
    for (const std::uint32_t slot : regions[r].slots)
      if (slot != BlockDirectory::kNone)
        chunks.of(chunk_of(block(slot).coordinate)).push_back(slot);
  order_.clear(), chunks_.clear();
  chunks.for_each([&](Vec3i cube, const std::vector<std::uint32_t>& slots) {
    chunks_.push_back({cube, order_.size(), slots.size()});
    order_.insert(order_.end(), slots.begin(), slots.end());
  });
}

// --- frames

IntegrateReport VoxelVolume::integrate(const DepthFrame& frame) {
  IntegrateReport report;
  if (config_.history == History::none) clear();
  report.usable = set_frame(frame, config_, view_);
  if (!report.usable) return report;
  {
    const Stopwatch stopwatch(report.allocate_ms);
    std::vector<std::size_t> refused(view_.height);
    parallel_for(view_.height, 32, [&](std::size_t begin, std::size_t end) {
      refused[begin] = copy_rows(frame, static_cast<int>(begin), static_cast<int>(end), view_);
    });
    for (const std::size_t count : refused) report.refused_pixels += count;
    if (view_.spherical) fit_range_planes(view_);
    if (view_.slanted) fit_pinhole_planes(view_);
    report.left_out_blocks = allocate();
  }
  const Stopwatch stopwatch(report.integrate_ms);
  update_blocks();
  return report;
}

void VoxelVolume::update_blocks() {
  parallel_for(order_.size(), kIntegratedAtOnce, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t slot = order_[i];
      if (config_.history == History::none)
        integrate_first(view_, rows_[slot], block(slot));
      else if (may_see(view_, block(slot)))
        integrate_next(view_, block(slot), weights(slot));
    }
  });
}

}  // namespace mr::fusion
