#include <algorithm>
#include <memory>

#include "bytes.h"
#include "merge_contenders.h"
#include "mr/core/parallel.h"
#include "mr/core/simd.h"
#include "mr/kit/topology.h"
#include "mr/merge/islands.h"
#include "mr/merge/zipper.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

class MergeOurs final : public Work {
 public:
  MergeOurs(std::span<const kit::Part> parts, const merge::OverlapConfig& config, int threads)
      : parts_(parts), config_(config), arena_(threads) {}

  void clear() override { merged_ = {}; }
  void run(StageClock& clock) override {
    arena_.run([&] { merged_ = merge_parts(parts_, config_, clock); });
  }
  Message result() override {
    Message out;
    arena_.run([&] {
      const Mesh welded = kit::weld(merged_);
      out = to_message(welded);
      out["runs"] = binary(welded.runs);
    });
    return out;
  }

 private:
  std::span<const kit::Part> parts_;
  merge::OverlapConfig config_;
  Arena arena_;
  Mesh merged_;
};

}  // namespace

Mesh merge_parts(std::span<const kit::Part> parts, const merge::OverlapConfig& config,
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

Contender merge_ours(const std::string& name, std::span<const kit::Part> parts,
                     const merge::OverlapConfig& config, int threads) {
  apply_simd_override();
  return {name, threads, Message::object(),
          [=] { return std::make_unique<MergeOurs>(parts, config, threads); }};
}

}  // namespace mr::bench
