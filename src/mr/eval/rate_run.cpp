#include "mr/eval/rate_run.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>
#include <optional>
#include <utility>

#include "mr/codec/head.h"
#include "mr/eval/draw_scene.h"
#include "mr/eval/multi_view_ssim.h"
#include "mr/eval/reference.h"
#include "mr/render/renderer.h"
#include "mr/runtime/lockstep_scene.h"

namespace mr::eval {
namespace {

/// What a client shows at the end of each second, beside the reference.
class ShownSeconds {
 public:
  static Result<ShownSeconds> prepare(const Scene& scene, const RateRun& run, int fps,
                                      const QualityConfig& config) {
    ShownSeconds out;
    if (run.views == 0) return out;
    const auto trial = Trial::prepare(scene, config);
    if (!trial) return trial.error();
    out.views_ = trial->plan().views;
    out.views_.resize(std::min(run.views, out.views_.size()));
    auto renderer = render::Renderer::create();
    if (!renderer) return renderer.error();
    out.renderer_.emplace(*std::move(renderer));
    std::vector<int> captures;
    for (int s = 1; s <= run.seconds; ++s) {
      const int capture = s * fps - 1, loop = trial->moments().loop;
      captures.push_back(loop > 0 ? capture % loop : capture);
    }
    const auto reference =
        reference_pictures(scene, trial->reference(), captures, out.views_, config.rig_cache,
                           config.eval_cache, [&](std::size_t done, std::size_t of) {
                             if (config.progress) config.progress("reference", done, of);
                           });
    if (!reference) return reference.error();
    if (const Status added = out.metric_.add(*reference); !added) return added.error();
    return out;
  }

  /// `shown`: null before the first capture is.
  Status measure(int second, const DecodedScene* shown, const RateRun& run, RateSecond& out) {
    if (views_.empty() || shown == nullptr) return {};
    std::vector<ImageRgb> pictures;
    double sum = 0;
    for (std::size_t v = 0; v < views_.size(); ++v) {
      auto drawn = draw_scene(*renderer_, *shown, views_[v]);
      if (!drawn) return drawn.error();
      const auto score = metric_.compare(static_cast<std::size_t>(second), v, luma_of(drawn->color),
                                         drawn->covered);
      if (!score) return score.error();
      sum += score->ssim_masked;
      pictures.push_back(std::move(drawn->color));
    }
    out.ssim = sum / static_cast<double>(views_.size());
    return run.pictures ? run.pictures(second, pictures) : Status();
  }

 private:
  std::vector<render::Viewpoint> views_;
  std::optional<render::Renderer> renderer_;
  MultiViewSsim metric_;
};

}  // namespace

Result<std::vector<RateSecond>> run_rate(const Scene& scene, const RateRun& run,
                                         const QualityConfig& config) {
  if (scene.rate.model == RateConfig::Model::fixed)
    return Error{Error::Cause::invalid, "scene '" + scene.id + "': rate.model is fixed"};
  auto opened = runtime::LockstepScene::open(scene, config.rig_cache);
  if (!opened) return opened.error();
  runtime::LockstepScene& pipeline = **opened;
  const int fps = std::max(1, static_cast<int>(std::lround(scene.fps)));
  auto shown = ShownSeconds::prepare(scene, run, fps, config);
  if (!shown) return shown.error();
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
  for (int s = 0; s < run.seconds; ++s) {
    out.emplace_back();
    for (int i = 0; i < fps; ++i) {
      const double target = run.trace.mbps(s + static_cast<double>(i) / fps);
      out.back().target_mbps += target / fps;
      pipeline.set_target(target);
      const auto ran = pipeline.run(1, listener);
      if (!ran && ran.error().cause != Error::Cause::empty) return ran.error();
    }
    const auto& decoded = pipeline.decoded();
    if (const Status ok = shown->measure(s, decoded ? &*decoded : nullptr, run, out.back()); !ok)
      return ok.error();
    if (config.progress)
      config.progress("rate", static_cast<std::size_t>(s + 1),
                      static_cast<std::size_t>(run.seconds));
  }
  return out;
}

}  // namespace mr::eval
