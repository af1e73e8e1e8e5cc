#include "simplify_case.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <functional>
#include <optional>
#include <stdexcept>

#include "fuse_contenders.h"
#include "mr/core/parallel.h"
#include "mr/runtime/lockstep_scene.h"
#include "mr/simplify/simplify.h"
#include "scene_input.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

struct Share {
  const char* name;
  double ratio;
  bool of_all_inputs;  ///< by default; else of the default one only
};
constexpr std::array<Share, 4> kShares{
    {{"50%", 0.5, false}, {"25%", 0.25, false}, {"10%", 0.1, true}, {"5%", 0.05, false}}};

const std::string kFrame = "room_bench", kRigTwin = "rig", kKitchen = "kitchen", kMerged = "merged";

/// A mesh to decimate. name: before the shares; empty for the default one.
struct Input {
  std::string name, what;
  bool by_default = false;
  std::string missing{};
};

std::filesystem::path merged_scene() {
  return std::filesystem::path(MR_SOURCE_DIR) / "examples/red-kitchen.yaml";
}

/// The fuse stage's frames, the default one of them first, and the merged surface.
std::vector<Input> own_inputs() {
  std::vector<Input> out(1);
  std::string no_kitchen;
  for (const CaseInfo& frame : fuse_cases()) {
    if (frame.name == kFrame)
      out[0] = {"", frame.missing.empty() ? frame.what : "the synthetic twin of room_bench", true};
    else
      out.push_back({frame.name, frame.what, frame.name == kKitchen, frame.missing});
    if (frame.name.starts_with(kKitchen) && no_kitchen.empty()) no_kitchen = frame.missing;
  }
  out.push_back({kMerged, "the merged surface of examples/red-kitchen.yaml", true, no_kitchen});
  return out;
}

std::string case_name(const std::string& input, const Share& share) {
  return input.empty() ? share.name : input + "/" + share.name;
}

std::vector<CaseInfo> cases_of(const std::vector<Input>& inputs) {
  std::vector<CaseInfo> out;
  for (const Input& input : inputs)
    for (const Share& share : kShares)
      out.push_back({case_name(input.name, share), input.what + fmt::format(", to {}", share.name),
                     input.by_default && (input.name.empty() || share.of_all_inputs),
                     input.missing});
  return out;
}

// ------------------------------------------------------------ what takes threads: in a child

/// As the fuse stage's "ours" does it.
Message fused(const FuseCase& frame) {
  constexpr int kAllCores = 0;
  const auto work = fuse_ours(frame, kAllCores).front().make();
  StageClock clock;
  work->run(clock);
  return work->result();
}

/// The red kitchen's surface as its root would decimate it, from sensors that do not: no triangle
/// of it depends on ours.
Message merged() {
  ::setenv("MR_DATA", std::filesystem::absolute(data_folder()).c_str(), 1);
  Scene scene = load_or_throw(merged_scene());
  scene.simplify.ratio = 1;
  // Of what the sensors sent: more than all that cutting along overlaps added to it.
  scene.merge.simplify.ratio = 1e3;
  scene.coding.texture_scale = 0.125;  // pictures are of no use here
  Arena arena(0);
  Message out;
  arena.run([&] {
    auto pipeline = runtime::LockstepScene::open(std::move(scene));
    if (!pipeline) throw std::runtime_error(pipeline.error().message);
    const auto ran = (*pipeline)->run(1);  // the client refuses a packet with such a ratio
    const std::optional<Mesh> surface = (*pipeline)->surface();
    if (!surface) throw std::runtime_error(ran ? "no merged surface" : ran.error().message);
    out = to_message(*surface);
  });
  return out;
}

Result<std::shared_ptr<const Mesh>> mesh_by(const std::function<Message()>& make) {
  const auto outcome = apart(make);
  if (!outcome) return outcome.error();
  return std::make_shared<const Mesh>(mesh_from(*outcome));
}

/// A mesh and what it is called in the report.
struct Loaded {
  std::string source;
  std::shared_ptr<const Mesh> mesh;
};

Result<Loaded> load_own(const std::string& input) {
  Loaded out{input, nullptr};
  if (input.empty()) {
    const auto frames = fuse_cases();
    out.source =
        std::ranges::any_of(frames,
                            [](const CaseInfo& c) { return c.name == kFrame && c.missing.empty(); })
            ? kFrame
            : kRigTwin;
  }
  auto mesh = [&]() -> Result<std::shared_ptr<const Mesh>> {
    if (input == kMerged) return mesh_by(merged);
    const auto frame = load_fuse_case(out.source);
    if (!frame) return frame.error();
    return mesh_by([&] { return fused(*frame); });
  }();
  if (!mesh) return mesh.error();
  out.mesh = *std::move(mesh);
  return out;
}

using Loader = std::function<Result<Loaded>(const std::string& input)>;

/// The cases by name; every mesh is loaded once.
Result<std::vector<SimplifyCase>> load_cases(const std::vector<Input>& inputs,
                                             const std::vector<std::string>& names,
                                             const Loader& load, cli::ProgressBar& bar) {
  std::vector<SimplifyCase> out;
  for (const Input& input : inputs) {
    std::optional<Loaded> loaded;
    for (const Share& share : kShares) {
      const std::string name = case_name(input.name, share);
      if (std::ranges::find(names, name) == names.end()) continue;
      bar.show("loading", out.size(), names.size());
      if (!loaded) {
        auto one = load(input.name);
        if (!one) return one.error();
        loaded = *std::move(one);
      }
      out.push_back(
          {name, loaded->source, loaded->mesh, simplify::triangles_at(*loaded->mesh, share.ratio)});
    }
  }
  return out;
}

Result<std::vector<SimplifyCase>> load_scene_cases(const Request& request, cli::ProgressBar& bar) {
  const auto frames = load_fuse_scene(request.input);
  if (!frames) return frames.error();
  std::vector<Input> inputs;
  for (const FuseCase& frame : *frames)
    inputs.push_back({frame.name, "sensor " + frame.name, true, {}});
  const auto names = wanted_cases(cases_of(inputs), request, request.input.string() + " has");
  if (!names) return names.error();
  const auto load = [&](const std::string& input) -> Result<Loaded> {
    const auto frame = std::ranges::find(*frames, input, &FuseCase::name);
    auto mesh = mesh_by([&] { return fused(*frame); });
    if (!mesh) return mesh.error();
    return Loaded{input, *std::move(mesh)};
  };
  return load_cases(inputs, *names, load, bar);
}

}  // namespace

std::vector<CaseInfo> simplify_cases() { return cases_of(own_inputs()); }

Result<std::vector<SimplifyCase>> load_simplify_cases(const Request& request,
                                                      cli::ProgressBar& bar) {
  if (!request.input.empty()) return load_scene_cases(request, bar);
  const auto names = wanted_cases(simplify_cases(), request, "simplify has");
  if (!names) return names.error();
  return load_cases(own_inputs(), *names, load_own, bar);
}

}  // namespace mr::bench
