#include <chrono>
#include <cmath>

#include "bytes.h"
#include "mr/core/parallel.h"
#include "mr/kit/raster.h"
#include "mr/kit/raycast.h"
#include "mr/merge/overlap/occlusion_rule.h"
#include "mr/merge/overlap/ray_votes.h"
#include "overlap_contenders.h"

namespace mr::bench {
namespace {

constexpr float kNear_m = static_cast<float>(kit::kNearPlane_m), kFar_m = 1e6f;

class Embree final : public Work {
 public:
  Embree(const MergeCase& input, int threads) : input_(input), arena_(threads) {
    for (const kit::Part& part : input.parts) {
      meshes_.push_back(&part.mesh);
      for (const SourceInfo& source : part.sources)
        for (const merge::RayGrid& grid : merge::camera_rays(source, input.voxel_m))
          pictures_.push_back({grid, std::vector<Row>(grid.camera.height)});
    }
  }

  void clear() override {
    for (Picture& picture : pictures_)
      for (Row& row : picture.rows) row.hits.clear(), row.first.clear();
  }

  void run(StageClock& clock) override {
    arena_.run([&] {
      const kit::RayScene scene(meshes_);
      clock.lap("build");
      for (Picture& picture : pictures_) cast(scene, picture);
      clock.lap("hits");
    });
  }

  Message result() override {
    const auto config = paper_config(input_, merge::MergeConfig::Overlap::rays);
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::uint8_t> all;
    arena_.run([&] {
      for (const auto& part : merge::farther_triangles(input_.parts, config))
        all.insert(all.end(), part.begin(), part.end());
    });
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
    return {{"gone", binary(all)}, {"with_decisions_ms", std::round(took.count() * 1e3) / 1e3}};
  }

 private:
  /// The hits of a row of pixels.
  struct Row {
    std::vector<kit::RayHit> hits;
    std::vector<std::uint32_t> first;  ///< [width] pixel → its first hit
  };
  struct Picture {
    merge::RayGrid grid;
    std::vector<Row> rows;
  };

  static void cast(const kit::RayScene& scene, Picture& picture) {
    const merge::RayPencil rays(picture.grid);
    parallel_for(picture.rows.size(), 4, [&](std::size_t begin, std::size_t end) {
      std::vector<kit::RayHit> hits;
      for (std::size_t y = begin; y < end; ++y) {
        Row& row = picture.rows[y];
        for (int x = 0; x < picture.grid.camera.width; ++x) {
          row.first.push_back(static_cast<std::uint32_t>(row.hits.size()));
          scene.all_hits(rays.origin, rays.at(x, static_cast<int>(y)), kNear_m, kFar_m, hits);
          row.hits.insert(row.hits.end(), hits.begin(), hits.end());
        }
      }
    });
  }

  const MergeCase& input_;
  Arena arena_;
  std::vector<const Mesh*> meshes_;
  std::vector<Picture> pictures_;
};

}  // namespace

Contender overlap_embree(const MergeCase& input, int threads) {
  return {"embree", threads, Message::object(),
          [&input, threads] { return std::make_unique<Embree>(input, threads); }};
}

merge::OverlapConfig paper_config(const MergeCase& input, merge::MergeConfig::Overlap how) {
  return {.owner = merge::MergeConfig::Owner::paper,
          .overlap = how,
          .voxel_m = input.voxel_m,
          .calibration_error_m = input.config.calibration_error_m};
}

}  // namespace mr::bench
