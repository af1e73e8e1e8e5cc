#include <memory>

#include "merge_contenders.h"
#include "mr/core/parallel.h"
#include "mr/core/simd.h"
#include "mr/kit/topology.h"
#include "mr/merge/islands.h"
#include "mr/merge/zipper.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

class Ours final : public Work {
 public:
  Ours(std::span<const merge::Part> parts, const merge::OverlapConfig& config, int threads)
      : parts_(parts), config_(config), arena_(threads) {}

  void clear() override { merged_ = {}; }
  void run(StageClock& clock) override {
    arena_.run([&] { merged_ = merge_parts(parts_, config_, clock); });
  }
  /// As the next node takes it.
  Message result() override {
    Message out;
    arena_.run([&] { out = to_message(kit::weld(merged_)); });
    return out;
  }

 private:
  std::span<const merge::Part> parts_;
  merge::OverlapConfig config_;
  Arena arena_;
  Mesh merged_;
};

}  // namespace

Mesh merge_parts(std::span<const merge::Part> parts, const merge::OverlapConfig& config,
                 StageClock& clock) {
  clock.skip();
  std::vector<Mesh> owned = merge::remove_overlap(parts, config);
  clock.lap("overlap");
  parallel_for(owned.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      owned[i] = merge::remove_islands(owned[i], merge::island_area_m2(config.voxel_m));
  });
  clock.lap("islands");
  Mesh merged = merge::zip(owned, merge::zipper_config(config.voxel_m));
  clock.lap("zipper");
  return merged;
}

merge::OverlapConfig overlap_config(const MergeCase& input) {
  return {.owner = input.config.owner,
          .overlap = input.config.overlap,
          .voxel_m = input.voxel_m,
          .calibration_error_m = input.config.calibration_error_m};
}

Contender merge_ours(const std::string& name, std::span<const merge::Part> parts,
                     const merge::OverlapConfig& config, int threads) {
  apply_simd_override();
  return {name, threads, Message::object(),
          [=] { return std::make_unique<Ours>(parts, config, threads); }};
}

}  // namespace mr::bench
