#include "mr/eval/client_run.h"

#include <algorithm>
#include <utility>

#include "mr/baseline/run_baseline.h"

namespace mr::eval {
namespace {

/// The listener, also keeping what is shown. `first`: the capture that the run begins with.
runtime::RunListener keeping(const runtime::RunListener& listener, int first, int kept,
                             std::vector<ClientCapture>& last) {
  runtime::RunListener out = listener;
  out.shown = [&last, first, kept, shown = listener.shown](int i, const DecodedScene& scene) {
    if (shown) shown(i, scene);
    if (!last.empty()) last.back().scene.textures.clear();
    last.push_back({first + i, scene});
    if (last.size() > static_cast<std::size_t>(kept)) last.erase(last.begin());
  };
  return out;
}

}  // namespace

Result<ClientRun> run_client(const Scene& scene, int captures, int kept,
                             const runtime::RunListener& listener,
                             const std::filesystem::path& rig_cache) {
  ClientRun out;
  if (scene.pipeline != "meshreduce") {
    const int every = scene.coding.frame_divider;  // so that the last capture is one that is sent
    const int coded = 1 + (std::min(captures, kept) - 1) / every * every;
    const int first = captures - coded;
    const auto run = baseline::run_baseline(scene, coded, first,
                                            keeping(listener, first, kept, out.last), rig_cache);
    if (!run) return run.error();
    return out;
  }
  auto pipeline = runtime::LockstepScene::open(scene, rig_cache);
  if (!pipeline) return pipeline.error();
  const auto report = (*pipeline)->run(captures, keeping(listener, 0, kept, out.last));
  if (!report) return report.error();
  out.pairs = report->pairs;
  return out;
}

}  // namespace mr::eval
