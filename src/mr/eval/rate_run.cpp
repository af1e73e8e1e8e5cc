#include "mr/eval/rate_run.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>

#include "mr/codec/head.h"
#include "mr/runtime/lockstep_scene.h"

namespace mr::eval {

Result<std::vector<RateSecond>> run_rate(const Scene& scene, const rate::Trace& trace, int seconds,
                                         const QualityConfig& config) {
  if (scene.rate.model == RateConfig::Model::fixed)
    return Error{Error::Cause::invalid, "scene '" + scene.id + "': rate.model is fixed"};
  auto opened = runtime::LockstepScene::open(scene, config.rig_cache);
  if (!opened) return opened.error();
  runtime::LockstepScene& pipeline = **opened;
  const int fps = std::max(1, static_cast<int>(std::lround(scene.fps)));
  std::vector<RateSecond> out;
  std::deque<double> last_second;  // Mbit of its captures
  runtime::RunListener listener;
  listener.captured = [&](int, const runtime::CaptureCost& cost) {
    RateSecond& second = out.back();
    const double mbit =
        static_cast<double>(cost.mesh_bytes + cost.texture_bytes + cost.head_bytes) * 8e-6;
    last_second.push_back(mbit);
    if (last_second.size() > static_cast<std::size_t>(fps)) last_second.pop_front();
    second.mbps += mbit;
    second.refinement_mbps += static_cast<double>(cost.still_bytes + cost.plate_bytes) * 8e-6;
    second.worst_mbps =
        std::max(second.worst_mbps, std::accumulate(last_second.begin(), last_second.end(), 0.0));
    second.left_out += !cost.shown, second.key_frames += cost.key_frame;
    if (!cost.shown) return;
    second.qp = cost.plan.texture_qp, second.scale = cost.plan.texture_scale;
    second.error_voxels = cost.plan.decimation.error_m / scene.voxel_m;
    second.still_chunks = static_cast<std::size_t>(std::ranges::count_if(
        pipeline.decoded()->chunks,
        [](const auto& chunk) { return chunk->key.id.layer == Layer::still; }));
  };
  for (int s = 0; s < seconds; ++s) {
    out.emplace_back();
    for (int i = 0; i < fps; ++i) {
      const double target = trace.mbps(s + static_cast<double>(i) / fps);
      out.back().target_mbps += target / fps;
      pipeline.set_target(target);
      const auto ran = pipeline.run(1, listener);
      if (!ran && ran.error().cause != Error::Cause::empty) return ran.error();
    }
    if (config.progress)
      config.progress("rate", static_cast<std::size_t>(s + 1), static_cast<std::size_t>(seconds));
  }
  return out;
}

}  // namespace mr::eval
