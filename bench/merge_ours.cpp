#include <algorithm>
#include <memory>

#include "bytes.h"
#include "merge_contenders.h"
#include "mr/atlas/labels.h"
#include "mr/core/parallel.h"
#include "mr/core/simd.h"
#include "mr/kit/topology.h"
#include "mr/merge/islands.h"
#include "mr/merge/zipper.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

/// What a merger that is not the root hands on: every triangle with the sensor that sees it best,
/// here from where its depth camera is.
Mesh labelled(const Mesh& mesh, std::span<const merge::Part> parts,
              const merge::OverlapConfig& config) {
  std::vector<View> views;
  atlas::LabelConfig label{.min_edge_m = 2 * config.voxel_m};
  for (const merge::Part& part : parts)
    for (const SourceInfo& source : part.sources) {
      const Camera& k = source.depth_camera;
      View view;
      view.id = source.sensor, view.width = k.width, view.height = k.height;
      view.fx = k.fx, view.fy = k.fy, view.cx = k.cx, view.cy = k.cy;
      view.T_world_camera = source.T_world_depth;
      view.image_rect = view.atlas_rect = {0, 0, k.width, k.height};
      views.push_back(view);
      label.precision = source.precision;
    }
  std::ranges::sort(views, {}, &View::id);
  return atlas::label_triangles(mesh, views, label);
}

class Ours final : public Work {
 public:
  Ours(std::span<const merge::Part> parts, const merge::OverlapConfig& config, int threads,
       Handed handed)
      : parts_(parts), config_(config), handed_(handed), arena_(threads) {}

  void clear() override { merged_ = {}; }
  void run(StageClock& clock) override {
    arena_.run([&] { merged_ = merge_parts(parts_, config_, clock); });
  }
  Message result() override {
    Message out;
    arena_.run([&] {
      const Mesh welded = kit::weld(merged_);
      const Mesh handed = handed_ == Handed::labelled ? labelled(welded, parts_, config_) : welded;
      out = to_message(handed);
      out["runs"] = binary(handed.runs);
    });
    return out;
  }

 private:
  std::span<const merge::Part> parts_;
  merge::OverlapConfig config_;
  Handed handed_;
  Arena arena_;
  Mesh merged_;
};

}  // namespace

Mesh merge_parts(std::span<const merge::Part> parts, const merge::OverlapConfig& config,
                 StageClock& clock) {
  clock.skip();
  std::vector<Mesh> owned = merge::remove_overlap(parts, config);
  clock.lap("overlap");
  const Mesh zipped = merge::zip(owned, merge::zipper_config(config.voxel_m));
  clock.lap("zipper");
  Mesh merged = merge::remove_islands(zipped, merge::island_area_m2(config.voxel_m));
  clock.lap("islands");
  return merged;
}

merge::OverlapConfig overlap_config(const MergeCase& input) {
  return {.owner = input.config.owner,
          .overlap = input.config.overlap,
          .voxel_m = input.voxel_m,
          .calibration_error_m = input.config.calibration_error_m};
}

Contender merge_ours(const std::string& name, std::span<const merge::Part> parts,
                     const merge::OverlapConfig& config, int threads, Handed handed) {
  apply_simd_override();
  return {name, threads, Message::object(),
          [=] { return std::make_unique<Ours>(parts, config, threads, handed); }};
}

}  // namespace mr::bench
