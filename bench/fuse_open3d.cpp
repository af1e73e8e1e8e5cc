#include <fmt/format.h>
#include <omp.h>
#include <open3d/core/Tensor.h>
#include <open3d/t/geometry/VoxelBlockGrid.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <limits>
#include <optional>

#include "fuse_contenders.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

using open3d::core::Tensor;
namespace o3d = open3d::t::geometry;

/// Blocks of 8 and of 16 voxels, and the room for blocks that is tried: more of it costs time to
/// clear, less of it makes the map grow.
struct BlockSide {
  int voxels;
  std::array<int, 6> capacities;
};
constexpr std::array<BlockSide, 2> kBlockSides{
    {{8, {1024, 2048, 4096, 8192, 16384, 32768}}, {16, {256, 512, 1024, 2048, 4096, 8192}}}};

struct GridConfig {
  int block_side = 8;  ///< voxels
  int capacity = 0;    ///< blocks that it makes room for; more make it grow
};

/// Open3D's parallel loops use OpenMP with OMP_NUM_THREADS threads (default: one per core,
/// regardless of omp_set_num_threads); its block search and hash map use TBB.
class Threads {
 public:
  explicit Threads(int count)
      : tbb_(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(count)) {
    ::setenv("OMP_NUM_THREADS", std::to_string(count).c_str(), 1);
    ::omp_set_num_threads(count);
  }

 private:
  tbb::global_control tbb_;
};

class FuseOpen3d final : public Work {
 public:
  FuseOpen3d(const FuseCase& input, int threads, GridConfig grid)
      : input_(input),
        grid_(grid),
        threads_(threads),
        depth_(Tensor(input.depth.data, {input.depth.height, input.depth.width, 1},
                      open3d::core::Float32, device_)) {
    const Camera& k = input.camera;
    intrinsic_ = Tensor(std::vector<double>{k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1}, {3, 3},
                        open3d::core::Float64, device_);
    // It cuts off pixel coordinates: half a pixel more, and it finds the nearest one, as we do.
    look_up_ = Tensor(std::vector<double>{k.fx, 0, k.cx + 0.5, 0, k.fy, k.cy + 0.5, 0, 0, 1},
                      {3, 3}, open3d::core::Float64, device_);
    const auto world_to_camera = input.T_world_camera.inverse().matrix();
    extrinsic_ = Tensor(std::vector<double>(world_to_camera.begin(), world_to_camera.end()), {4, 4},
                        open3d::core::Float64, device_);
  }

  void clear() override { mesh_.reset(); }

  void run(StageClock& clock) override {
    constexpr float kDepthScale = 1;  // metres already
    const auto limit_m = static_cast<float>(input_.limit_m);
    const auto band_voxels = static_cast<float>(input_.truncation_m / input_.voxel_m);
    o3d::VoxelBlockGrid grid({"tsdf", "weight"}, {open3d::core::Float32, open3d::core::Float32},
                             {{1}, {1}}, static_cast<float>(input_.voxel_m), grid_.block_side,
                             grid_.capacity, device_);
    const Tensor blocks = grid.GetUniqueBlockCoordinates(depth_, intrinsic_, extrinsic_,
                                                         kDepthScale, limit_m, band_voxels);
    clock.lap("allocate");
    grid.Integrate(blocks, depth_, look_up_, extrinsic_, kDepthScale, limit_m, band_voxels);
    clock.lap("integrate");
    mesh_ = grid.ExtractTriangleMesh(0.0f);
    clock.lap("extract");
  }

  Message result() override {
    const Tensor positions = mesh_->GetVertexPositions().To(open3d::core::Float32).Contiguous();
    const Tensor triangles = mesh_->GetTriangleIndices().To(open3d::core::Int32).Contiguous();
    const auto* position = static_cast<const float*>(positions.GetDataPtr());
    const auto* corner = static_cast<const std::int32_t*>(triangles.GetDataPtr());
    Mesh mesh;
    for (std::int64_t v = 0; v < positions.GetLength(); ++v, position += 3)
      mesh.positions.push_back({position[0], position[1], position[2]});
    for (std::int64_t t = 0; t < triangles.GetLength(); ++t, corner += 3)
      mesh.triangles.push_back({static_cast<std::uint32_t>(corner[0]),
                                static_cast<std::uint32_t>(corner[1]),
                                static_cast<std::uint32_t>(corner[2])});
    return to_message(mesh);
  }

 private:
  const FuseCase& input_;
  const GridConfig grid_;
  const Threads threads_;
  const open3d::core::Device device_{"CPU:0"};
  const o3d::Image depth_;
  Tensor intrinsic_, look_up_, extrinsic_;
  std::optional<o3d::TriangleMesh> mesh_;
};

Contender contender(const FuseCase& input, int threads, GridConfig grid) {
  return {fmt::format("open3d/{}", grid.block_side), threads, Message{{"capacity", grid.capacity}},
          [&input, threads, grid] { return std::make_unique<FuseOpen3d>(input, threads, grid); }};
}

/// The contender whose quickest run was the quickest; the first when all died.
std::size_t quickest(const std::vector<Contender>& contenders) {
  const auto outcomes =
      race(contenders, {.warm_ups = 1, .runs = 3, .wants_results = false, .quiet = true});
  std::size_t best = 0;
  double best_ms = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    if (!outcomes[i].aborted.empty() || !outcomes[i].usable()) continue;
    const double ms = *std::min_element(outcomes[i].ms.begin(), outcomes[i].ms.end());
    if (ms < best_ms) best = i, best_ms = ms;
  }
  return best;
}

}  // namespace

bool has_open3d() { return true; }

std::vector<Contender> fuse_open3d(const FuseCase& input, int threads) {
  std::vector<Contender> out;
  for (const BlockSide& side : kBlockSides) {
    std::vector<Contender> tried;
    for (const int capacity : side.capacities)
      tried.push_back(contender(input, threads, {side.voxels, capacity}));
    out.push_back(tried[quickest(tried)]);
  }
  return out;
}

}  // namespace mr::bench
