#include <algorithm>
#include <memory>

#include "bytes.h"
#include "merge_contenders.h"
#include "mr/core/parallel.h"
#include "mr/core/simd.h"
#include "mr/kit/topology.h"
#include "mr/merge/merge_surfaces.h"
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
      out["sensors"] = binary(welded.sensors);
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
  merge::MergeHooks hooks;
  hooks.step = [&](const char* step, const std::function<void()>& work) {
    work();
    clock.lap(step);
  };
  return merge::merge_surfaces(parts, merge::surfaces_config(config), nullptr, hooks);
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
