#include <string>

#include "fuse_contenders.h"
#include "mr/core/parallel.h"
#include "mr/core/simd.h"
#include "mr/fusion/marching_cubes.h"
#include "mr/fusion/voxel_volume.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

/// As a sensor node does it: the volume and the mesh keep their memory from frame to frame.
class FuseOurs final : public Work {
 public:
  FuseOurs(const FuseCase& input, int threads, fusion::DepthEdges edges, bool slanted)
      : input_(input),
        slanted_(slanted),
        arena_(threads),
        volume_({.voxel_m = input.voxel_m,
                 .truncation_m = input.truncation_m,
                 .bounds = {},
                 .history = fusion::History::none}),
        marching_cubes_(edges) {}

  void clear() override {}

  void run(StageClock& clock) override {
    arena_.run([&] {
      const fusion::IntegrateReport made =
          volume_.integrate({.depth = input_.depth,
                             .camera = input_.camera,
                             .T_world_camera = input_.T_world_camera,
                             .region = {0, 0, input_.depth.width, input_.depth.height},
                             .precision = {},
                             .slanted = slanted_});
      clock.skip();
      clock.add("allocate", made.allocate_ms);
      clock.add("integrate", made.integrate_ms);
      marching_cubes_.run(volume_, surface_);
      clock.lap("extract");
    });
  }

  Message result() override { return to_message(surface_.mesh); }

 private:
  const FuseCase& input_;
  bool slanted_;
  Arena arena_;
  fusion::VoxelVolume volume_;
  fusion::MarchingCubes marching_cubes_;
  fusion::Surface surface_;
};

Contender contender(const std::string& name, const FuseCase& input, int threads,
                    fusion::DepthEdges edges, bool slanted = false) {
  return {name, threads, Message{{"simd", simd_target()}}, [&input, threads, edges, slanted] {
            return std::make_unique<FuseOurs>(input, threads, edges, slanted);
          }};
}

}  // namespace

std::vector<Contender> fuse_ours(const FuseCase& input, int threads) {
  apply_simd_override();
  return {contender("ours", input, threads, fusion::DepthEdges::bridge),
          contender("ours/cut", input, threads, fusion::DepthEdges::cut),
          contender("ours/planes", input, threads, fusion::DepthEdges::cut, true)};
}

std::vector<Contender> scan_contenders(const FuseCase& scan, const FuseCase& room, int threads) {
  apply_simd_override();
  return {contender("ours", scan, threads, fusion::DepthEdges::cut),
          contender(kFuseRoom, room, threads, fusion::DepthEdges::bridge),
          contender(kFuseRoom + "/planes", room, threads, fusion::DepthEdges::cut, true)};
}

}  // namespace mr::bench
