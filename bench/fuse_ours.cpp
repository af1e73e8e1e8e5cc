#include "fuse_contenders.h"
#include "mr/core/parallel.h"
#include "mr/fusion/marching_cubes.h"
#include "mr/fusion/voxel_volume.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

class Ours final : public Work {
 public:
  Ours(const FuseCase& input, int threads) : input_(input), arena_(threads) {}

  void clear() override { mesh_ = Mesh{}; }

  void run(StageClock& clock) override {
    arena_.run([&] {
      fusion::VoxelVolume volume({.voxel_m = input_.voxel_m,
                                  .truncation_m = input_.truncation_m,
                                  .history = fusion::History::none});
      volume.integrate({.depth = input_.depth,
                        .camera = input_.camera,
                        .T_world_camera = input_.T_world_camera,
                        .region = {0, 0, input_.depth.width, input_.depth.height},
                        .precision = {}});
      clock.lap("integrate");
      mesh_ = fusion::extract_surface(volume, fusion::DepthEdges::bridge);
      clock.lap("extract");
    });
  }

  Message result() override { return to_message(mesh_); }

 private:
  const FuseCase& input_;
  Arena arena_;
  Mesh mesh_;
};

}  // namespace

Contender fuse_ours(const FuseCase& input, int threads) {
  return {"ours", threads, Message::object(),
          [&input, threads] { return std::make_unique<Ours>(input, threads); }};
}

}  // namespace mr::bench
