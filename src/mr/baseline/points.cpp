#include "mr/baseline/points.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mr/core/parallel.h"
#include "mr/kit/raster.h"

namespace mr::baseline {
namespace {

/// Along rows or columns, whichever lie farther apart.
double coarsest_px_per_rad(const Camera& camera) {
  const Vec2d density = kit::pixels_per_rad(camera);
  return std::min(density.x, density.y);
}

/// How near the nearest point lies in each cell of some pixels of a colour picture: cells are large
/// enough to leave no hole between the points of one surface.
class DepthBuffer {
 public:
  DepthBuffer(const View& view, const Camera& depth_camera)
      : camera_(view.camera()),
        cell_px_(std::max(2, static_cast<int>(std::ceil(2 * kit::pixels_per_rad(camera_).x /
                                                        coarsest_px_per_rad(depth_camera))))),
        nearest_((view.width + cell_px_ - 1) / cell_px_, (view.height + cell_px_ - 1) / cell_px_,
                 std::numeric_limits<float>::infinity()) {}

  /// A point of the colour camera's frame as a pixel; nothing when it is outside the picture.
  std::optional<Vec2d> pixel_of(Vec3d p) const {
    const auto pixel = project(camera_, p);
    if (!pixel || pixel->x < 0 || pixel->y < 0 || pixel->x > camera_.width - 1 ||
        pixel->y > camera_.height - 1)
      return std::nullopt;
    return pixel;
  }
  void add(Vec2d pixel, double range_m) {
    float& nearest = cell(pixel);
    nearest = std::min(nearest, static_cast<float>(range_m));
  }
  /// Slopes of up to some 80 degrees hide nothing of themselves.
  bool hidden(Vec2d pixel, double range_m) {
    constexpr double kNoise_m = 0.02, kSlope = 6;
    const double slack = kNoise_m + kSlope * cell_px_ * range_m / kit::pixels_per_rad(camera_).x;
    return range_m > static_cast<double>(cell(pixel)) + slack;
  }

 private:
  float& cell(Vec2d pixel) {
    return *nearest_.at(static_cast<int>(pixel.x) / cell_px_, static_cast<int>(pixel.y) / cell_px_);
  }

  Camera camera_;
  int cell_px_;
  ImageDepth nearest_;
};

struct Candidate {
  Vec3f position;
  Vec2d pixel;
  double range_m;  ///< from the colour camera
};

/// Adds up what lies in each voxel; numbers voxels in order of first use.
class VoxelMeans {
 public:
  VoxelMeans(double voxel_m, std::size_t points) : voxel_m_(voxel_m) {
    std::size_t size = 1024;
    while (size < points) size *= 2;  // there are fewer voxels than points, as a rule
    slots_.assign(size, kUnset);
  }

  void add(Vec3f p, std::array<std::uint8_t, 3> color) {
    Cell& cell = cell_of(p);
    cell.sum += vec_cast<double>(p);
    for (int c = 0; c < 3; ++c) cell.color[c] += color[c];
    ++cell.count;
  }
  PointSet means() const {
    PointSet out;
    for (const Cell& cell : cells_) {
      out.positions.push_back(vec_cast<float>(cell.sum / static_cast<double>(cell.count)));
      auto& color = out.colors.emplace_back();
      for (int c = 0; c < 3; ++c)
        color[c] = static_cast<std::uint8_t>((cell.color[c] + cell.count / 2) / cell.count);
    }
    return out;
  }

 private:
  static constexpr std::uint32_t kUnset = 0xFFFFFFFFu;
  struct Cell {
    Vec3i voxel;
    Vec3d sum;
    std::array<std::uint64_t, 3> color{};
    std::uint64_t count = 0;
  };

  Cell& cell_of(Vec3f p) {
    const auto index = [&](float v) { return static_cast<std::int32_t>(std::floor(v / voxel_m_)); };
    const Vec3i voxel{index(p.x), index(p.y), index(p.z)};
    if (2 * cells_.size() >= slots_.size()) grow();
    std::uint32_t& slot = slots_[slot_of(voxel)];
    if (slot == kUnset) {
      slot = static_cast<std::uint32_t>(cells_.size());
      cells_.push_back({voxel, {}, {}, 0});
    }
    return cells_[slot];
  }
  std::size_t slot_of(Vec3i voxel) const {
    std::size_t at = hash_cell(voxel) & (slots_.size() - 1);
    while (slots_[at] != kUnset && cells_[slots_[at]].voxel != voxel)
      at = (at + 1) & (slots_.size() - 1);
    return at;
  }
  void grow() {
    slots_.assign(2 * slots_.size(), kUnset);
    for (std::uint32_t i = 0; i < cells_.size(); ++i) slots_[slot_of(cells_[i].voxel)] = i;
  }

  double voxel_m_;
  std::vector<std::uint32_t> slots_;
  std::vector<Cell> cells_;
};

}  // namespace

void drop_flying_pixels(ImageDepth& depth, const Camera& camera, const Precision& precision) {
  constexpr int kFewest = 5;      // of eight; on a straight edge of a surface it is five
  constexpr float kSteepest = 6;  // some 80 degrees
  const ImageDepth from = depth;
  const auto per_m = kSteepest / static_cast<float>(coarsest_px_per_rad(camera));
  const bool wraps = camera.model != CameraModel::pinhole;
  parallel_for(depth.height, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < depth.width; ++x) {
        const float z = *from.at(x, y);
        const float reach = per_m * z + 3 * static_cast<float>(precision.sigma_m(z));
        int near = 0;
        for (int j = std::max(0, y - 1); j <= std::min(depth.height - 1, y + 1); ++j)
          for (int i = x - 1; i <= x + 1; ++i) {
            if (!wraps && (i < 0 || i >= depth.width)) continue;
            const float other = *from.at((i + depth.width) % depth.width, j);
            near += other > 0 && std::abs(other - z) <= reach;
          }
        if (near < kFewest + 1) *depth.at(x, y) = 0;  // it counts itself
      }
  });
}

PointSet colored_points(const PreparedDepth& depth, const ImageRgb& color, const View& view,
                        const std::optional<Box3d>& volume) {
  DepthBuffer buffer(view, depth.camera);
  const Pose T_view_world = view.T_world_camera.inverse();
  std::vector<Candidate> seen;
  for (int y = 0; y < depth.depth.height; ++y)
    for (int x = 0; x < depth.depth.width; ++x) {
      const double z = *depth.depth.at(x, y);
      if (z <= 0) continue;
      const Vec3d ray = unproject(depth.camera, {static_cast<double>(x), static_cast<double>(y)});
      const Vec3d p_world = depth.T_world_depth * (ray * z);
      if (volume && !volume->contains(p_world)) continue;
      const Vec3d p_view = T_view_world * p_world;
      const auto pixel = buffer.pixel_of(p_view);
      if (!pixel) continue;
      buffer.add(*pixel, length(p_view));
      seen.push_back({vec_cast<float>(p_world), *pixel, length(p_view)});
    }
  PointSet out;
  for (const Candidate& point : seen) {
    if (buffer.hidden(point.pixel, point.range_m)) continue;
    out.positions.push_back(point.position);
    out.colors.push_back(sample_bilinear(color, view.image_rect, point.pixel.x, point.pixel.y));
  }
  return out;
}

PointSet voxel_sampled(std::span<const PointSet> sets, double voxel_m) {
  std::size_t points = 0;
  for (const PointSet& set : sets) points += set.positions.size();
  VoxelMeans means(voxel_m, points);
  for (const PointSet& set : sets)
    for (std::size_t i = 0; i < set.positions.size(); ++i)
      means.add(set.positions[i], set.colors[i]);
  return means.means();
}

}  // namespace mr::baseline
