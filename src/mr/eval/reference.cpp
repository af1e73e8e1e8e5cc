#include "mr/eval/reference.h"

#include <fmt/format.h>

#include <algorithm>

#include "mr/atlas/labels.h"
#include "mr/baseline/monolithic.h"
#include "mr/eval/store.h"
#include "mr/kit/image_io.h"
#include "mr/node/capture.h"
#include "mr/node/sensor_node.h"
#include "mr/synth/room.h"
#include "mr/synth/truth.h"

namespace mr::eval {
namespace {

using Pictures = std::vector<std::vector<RenderedView>>;

/// Another number whenever truth is stored differently.
constexpr double kTruthVersion = 2;
constexpr double kMonolithicVoxel_m = 0.01;

RenderedView drawn(synth::TruthPicture picture) {
  RenderedView out{std::move(picture.color), ImageMask(picture.depth.width, picture.depth.height)};
  for (std::size_t i = 0; i < out.covered.data.size(); ++i) {
    out.covered.data[i] = picture.depth.data[i] > 0 ? 1 : 0;
    if (!out.covered.data[i]) std::fill_n(&out.color.data[3 * i], 3, std::uint8_t{128});
  }
  return out;
}

/// Pictures of the truth as PNGs, each above its mask.
class TruthStore {
 public:
  TruthStore(const std::filesystem::path& cache_folder, const RigConfig& rig, double fps)
      : store_(store_folder(cache_folder, fmt::format("truth-{}-{:016x}", kTruthVersion,
                                                      synth::rig_key(rig, fps)))) {}

  std::optional<RenderedView> get(const render::Viewpoint& view, int frame) const {
    const auto png = store_.get(name(view, frame));
    const auto both = png ? kit::decode_color(*png) : Error{Error::Cause::not_found, ""};
    const int width = view.camera.width, height = view.camera.height;
    if (!both || both->width != width || both->height != 2 * height) return std::nullopt;
    RenderedView out{ImageRgb(width, height), ImageMask(width, height)};
    std::copy_n(both->data.begin(), out.color.data.size(), out.color.data.begin());
    for (std::size_t i = 0; i < out.covered.data.size(); ++i)
      out.covered.data[i] = both->row(height)[3 * i] ? 1 : 0;
    return out;
  }

  void put(const render::Viewpoint& view, int frame, const RenderedView& picture) const {
    ImageRgb both(picture.color.width, 2 * picture.color.height);
    std::copy(picture.color.data.begin(), picture.color.data.end(), both.data.begin());
    for (std::size_t i = 0; i < picture.covered.data.size(); ++i)
      std::fill_n(both.row(picture.color.height) + 3 * i, 3,
                  static_cast<std::uint8_t>(picture.covered.data[i] ? 255 : 0));
    if (const auto png = kit::encode_png(both)) store_.put(name(view, frame), *png);
  }

 private:
  static std::string name(const render::Viewpoint& view, int frame) {
    return Fingerprint{}.add(view.camera).add(view.T_world_camera).hex() +
           fmt::format("-{}.png", frame);
  }

  Store store_;
};

Result<Pictures> truth_pictures(const Scene& scene, const std::vector<int>& frames,
                                const std::vector<render::Viewpoint>& views,
                                const std::filesystem::path& cache_folder,
                                const Progress& progress) {
  const RigConfig* rig = known_rig(scene);
  if (!rig) return no_truth(scene);
  const TruthStore store(cache_folder, *rig, scene.fps);
  std::unique_ptr<synth::Truth> truth;  // made when something is missing
  Pictures out(frames.size(), std::vector<RenderedView>(views.size()));
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (progress) progress(v, views.size());
    std::unique_ptr<synth::TruthView> eye;
    for (std::size_t f = 0; f < frames.size(); ++f) {
      if (auto kept = store.get(views[v], frames[f])) {
        out[f][v] = *std::move(kept);
        continue;
      }
      if (!truth) truth = std::make_unique<synth::Truth>(*rig, scene.fps);
      if (!eye) eye = truth->view(views[v].camera, views[v].T_world_camera);
      out[f][v] = drawn(eye->at(static_cast<std::uint64_t>(frames[f])));
      store.put(views[v], frames[f], out[f][v]);
    }
  }
  if (progress) progress(views.size(), views.size());
  return out;
}

Result<Pictures> monolithic_pictures(const Scene& scene, const std::vector<int>& frames,
                                     const std::vector<render::Viewpoint>& views,
                                     const std::filesystem::path& rig_cache,
                                     const Progress& progress) {
  auto renderer = render::Renderer::create();
  if (!renderer) return renderer.error();
  Pictures out;
  for (const int frame : frames) {
    if (progress) progress(out.size(), frames.size());
    node::CaptureReader reader(scene, rig_cache);
    reader.skip(static_cast<std::uint64_t>(frame));
    const auto capture = reader.next();
    if (!capture || capture->empty())
      return Error{Error::Cause::empty,
                   fmt::format("scene '{}' has no capture {}", scene.id, frame)};
    const auto reference = monolithic_scene(scene, *capture);
    if (!reference) return reference.error();
    std::vector<RenderedView>& pictures = out.emplace_back();
    for (const render::Viewpoint& view : views) {
      auto picture = draw_scene(*renderer, *reference, view);
      if (!picture) return picture.error();
      pictures.push_back(*std::move(picture));
    }
  }
  if (progress) progress(out.size(), frames.size());
  return out;
}

}  // namespace

const RigConfig* known_rig(const Scene& scene) {
  if (scene.rig) return &*scene.rig;
  return scene.truth && scene.truth->rig ? &*scene.truth->rig : nullptr;
}

Error no_truth(const Scene& scene) {
  return {Error::Cause::unsupported, "scene '" + scene.id +
                                         "' has no rig, so its truth is not known; use --reference "
                                         "monolithic"};
}

const char* to_string(ReferenceKind kind) {
  return kind == ReferenceKind::truth ? "truth" : "monolithic";
}

ReferenceKind default_reference(const Scene& scene) {
  return known_rig(scene) ? ReferenceKind::truth : ReferenceKind::monolithic;
}

Result<DecodedScene> monolithic_scene(const Scene& scene, std::span<const Frame> capture) {
  DecodedScene out;
  out.views = baseline::color_views(scene, capture);
  if (out.views.empty())
    return Error{Error::Cause::empty, "scene '" + scene.id + "' has no colour"};
  const auto found = std::max_element(scene.sensors.begin(), scene.sensors.end(),
                                      [](const SensorConfig& a, const SensorConfig& b) {
                                        return a.precision.sigma_m(2) < b.precision.sigma_m(2);
                                      });
  Chunk chunk;
  chunk.mesh =
      atlas::label_triangles(baseline::fuse_all(scene, capture, kMonolithicVoxel_m), out.views,
                             {.views = AtlasConfig::Views::best_angle,
                              .geometry_error_m = node::texturing_error_m(scene, 0),
                              .precision = found->precision,
                              .min_edge_m = 2 * kMonolithicVoxel_m});
  if (chunk.mesh.empty())
    return Error{Error::Cause::empty, "scene '" + scene.id + "': a capture holds no surface"};
  out.chunks = {std::make_shared<const Chunk>(std::move(chunk))};
  for (const Frame& frame : capture) {
    if (frame.color.empty()) continue;
    out.textures[stream_of(frame.sensor)] = std::make_shared<const ImageRgb>(frame.color);
    out.captured_at = std::max(out.captured_at, frame.captured_at());
  }
  return out;
}

Result<std::vector<std::vector<RenderedView>>> reference_pictures(
    const Scene& scene, ReferenceKind kind, const std::vector<int>& frames,
    const std::vector<render::Viewpoint>& views, const std::filesystem::path& rig_cache,
    const std::filesystem::path& eval_cache, const Progress& progress) {
  if (kind == ReferenceKind::truth)
    return truth_pictures(scene, frames, views, eval_cache, progress);
  return monolithic_pictures(scene, frames, views, rig_cache, progress);
}

}  // namespace mr::eval
