#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/core/user_text.h"
#include "mr/net/address.h"
#include "mr/scene/scene.h"

namespace mr {
namespace {

std::vector<std::string> general_problems(const Scene& scene) {
  std::vector<std::string> out = out_of_range({{"fps", scene.fps, Scene::kFps},
                                               {"threads", scene.threads, Scene::kThreads},
                                               {"voxel_m", scene.voxel_m, Scene::kVoxel_m}});
  constexpr double kRounding = 1e-6;
  if (!(std::abs(length(scene.up) - 1) < kRounding))
    out.push_back("up must be a direction of length 1");
  if (std::ranges::find(Scene::kPipelines, scene.pipeline) == Scene::kPipelines.end())
    out.push_back("pipeline " + in_quotes(scene.pipeline) + " is not known");
  return out;
}

std::vector<std::string> lattice_problems(const Scene& scene) {
  std::vector<std::string> out = scene.lattice.problems();
  if (out.empty() && scene.lattice.step_exp > Lattice::kMeshStepExp.high &&
      scene.pipeline != "points")
    out.push_back("step_exp " + std::to_string(scene.lattice.step_exp) +
                  " is for pipeline points; browsers decode -9, -10 and -11");
  return out;
}

}  // namespace

std::vector<std::string> MergeConfig::problems() const {
  std::vector<std::string> out = merge::MergeConfig::problems();
  append(out, prefixed("simplify.", simplify.problems()));
  return out;
}

std::vector<std::string> GatewayConfig::problems() const {
  std::vector<std::string> out = out_of_range(
      {{"viewers", viewers, kViewers}, {"viewers_per_address", viewers_per_address, kViewers}});
  if (!net::is_address(listen))
    out.push_back("listen: " + in_quotes(listen) +
                  " is no address; write host:port, as in 127.0.0.1:8080");
  constexpr double kApart_m = 0.001;
  if (start && !(is_finite(start->eye) && is_finite(start->look_at)))
    out.push_back("start: eye and look_at must hold finite numbers");
  else if (start && !(length(start->look_at - start->eye) >= kApart_m))
    out.push_back("start: look_at must be another place than eye");
  if (tls && tls->cert.empty() != tls->key.empty())
    out.push_back("tls: cert and key only together; both are PEM files");
  return out;
}

std::vector<std::string> Scene::problems() const {
  std::vector<std::string> out = general_problems(*this);
  const auto add = [&](const std::string& key, std::vector<std::string> problems) {
    append(out, prefixed(key, std::move(problems)));
  };
  add("lattice.", lattice_problems(*this));
  add("video.", video.problems());
  add("volume ", box_problems(volume));
  if (floor) add("volume.remove_floor.", floor->problems());
  if (background) add("background.", background->problems());
  if (rig) add("rig.", rig->problems());
  for (const SensorConfig& sensor : sensors) add("sensors." + sensor.id + ".", sensor.problems());
  for (const MergerConfig& merger : mergers) add("mergers." + merger.id + ".", merger.problems());
  for (const LinkConfig& link : links) add("links: ", link.problems());
  add("fusion.", fusion.problems(voxel_m));
  add("simplify.", simplify.problems());
  add("merge.", merge.problems());
  add("atlas.", atlas.problems());
  add("still.", still.problems());
  add("rate.", rate.problems());
  add("coding.", coding.problems());
  if (gateway) add("gateway.", gateway->problems());
  add("", network.problems());
  return out;
}

}  // namespace mr
