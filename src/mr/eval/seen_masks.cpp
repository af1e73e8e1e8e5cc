#include "mr/eval/seen_masks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>

#include "mr/eval/geometry_error.h"
#include "mr/eval/sensor_coverage.h"
#include "mr/eval/still_error.h"
#include "mr/eval/store.h"
#include "mr/kit/raster.h"
#include "mr/synth/room.h"
#include "mr/synth/truth.h"

namespace mr::eval {
namespace {

constexpr int kSeenEvery = 10;  // captures
constexpr int kSeenBlock = 4;   // pixels: one point stands for so many each way

/// The point of a truth that stands for a block of a picture.
struct BlockPoint {
  std::size_t view = 0;
  int x = 0, y = 0;  ///< first pixel of the block
  SurfaceSample sample;
};

std::vector<BlockPoint> block_points(const Mesh& surface,
                                     const std::vector<render::Viewpoint>& views) {
  std::vector<BlockPoint> out;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const Camera& camera = views[v].camera;
    const kit::Raster raster = kit::rasterize(surface, camera, views[v].T_world_camera);
    for (int y = 0; y < camera.height; y += kSeenBlock)
      for (int x = 0; x < camera.width; x += kSeenBlock) {
        const int px = std::min(x + kSeenBlock / 2, camera.width - 1);
        const int py = std::min(y + kSeenBlock / 2, camera.height - 1);
        const std::uint32_t t = *raster.triangle.at(px, py);
        if (t == kit::kNoTriangle) continue;
        const Vec3d p = unproject(camera, {1.0 * px, 1.0 * py}) * *raster.depth.at(px, py);
        const Vec3d normal = normalized(vec_cast<double>(surface.area_normal(t)));
        out.push_back(
            {v, x, y, {vec_cast<float>(views[v].T_world_camera * p), vec_cast<float>(normal), t}});
      }
  }
  return out;
}

void mark_block(const BlockPoint& point, ImageMask& mask) {
  const int width = std::min(kSeenBlock, mask.width - point.x);
  for (int y = point.y; y < std::min(point.y + kSeenBlock, mask.height); ++y)
    std::fill_n(mask.at(point.x, y), width, std::uint8_t{1});
}

std::vector<ImageMask> blank_masks(const std::vector<render::Viewpoint>& views) {
  std::vector<ImageMask> out;
  for (const render::Viewpoint& view : views)
    out.emplace_back(view.camera.width, view.camera.height);
  return out;
}

/// The masks of one moment.
std::vector<ImageMask> look_back(const Scene& scene, synth::Truth& truth, int from, int shown,
                                 const std::vector<render::Viewpoint>& views) {
  const auto surface_at = [&](int capture) {
    return truth.surface(static_cast<std::uint64_t>(truth_frame(scene, capture))).mesh;
  };
  std::vector<ImageMask> out = blank_masks(views);
  const std::vector<SensorFrustum> frustums = sensor_frustums(scene);
  const Mesh now = surface_at(shown);
  std::vector<BlockPoint> left = block_points(now, views);
  for (int capture = shown; capture >= from && !left.empty(); capture -= kSeenEvery) {
    const Mesh then = capture == shown ? now : surface_at(capture);
    const auto still = still_triangles(now, then);
    if (capture != shown && then.triangles.size() == now.triangles.size() &&
        std::ranges::find(still, 0) == still.end())
      continue;  // nothing has moved
    std::vector<BlockPoint> looked_at, unseen;
    for (BlockPoint& point : left)
      (still[point.sample.triangle] ? looked_at : unseen).push_back(std::move(point));
    std::vector<SurfaceSample> samples;
    for (const BlockPoint& point : looked_at) samples.push_back(point.sample);
    const auto seen = seen_samples(then, samples, frustums, scene.voxel_m);
    for (std::size_t i = 0; i < looked_at.size(); ++i)
      if (seen[i])
        mark_block(looked_at[i], out[looked_at[i].view]);
      else
        unseen.push_back(looked_at[i]);
    left = std::move(unseen);
  }
  return out;
}

/// All masks of a moment one after another.
std::vector<std::byte> joined_masks(const std::vector<ImageMask>& masks) {
  std::vector<std::byte> out;
  for (const ImageMask& mask : masks) {
    const auto bytes = std::as_bytes(std::span(mask.data));
    out.insert(out.end(), bytes.begin(), bytes.end());
  }
  return out;
}

std::optional<std::vector<ImageMask>> masks_from(const std::vector<std::byte>& bytes,
                                                 const std::vector<render::Viewpoint>& views) {
  std::vector<ImageMask> out = blank_masks(views);
  std::size_t at = 0;
  for (ImageMask& mask : out) {
    if (bytes.size() - at < mask.data.size()) return std::nullopt;
    std::memcpy(mask.data.data(), &bytes[at], mask.data.size());
    at += mask.data.size();
  }
  return at == bytes.size() ? std::optional(std::move(out)) : std::nullopt;
}

Store seen_store(const Scene& scene, const RigConfig& rig,
                 const std::vector<render::Viewpoint>& views,
                 const std::filesystem::path& eval_cache) {
  Fingerprint print;
  print.add(program_fingerprint()).add(static_cast<double>(synth::rig_key(rig, scene.fps)));
  print.add(scene.voxel_m);
  for (const SensorFrustum& frustum : sensor_frustums(scene))
    print.add(frustum.depth_camera)
        .add(frustum.T_world_depth)
        .add(frustum.near_m)
        .add(frustum.far_m);
  for (const render::Viewpoint& view : views) print.add(view.camera).add(view.T_world_camera);
  return Store(store_folder(eval_cache, "seen-" + print.hex()));
}

}  // namespace

Result<std::vector<std::vector<ImageMask>>> seen_masks(const Scene& scene, const Moments& moments,
                                                       const std::vector<std::size_t>& wanted,
                                                       const std::vector<render::Viewpoint>& views,
                                                       const std::filesystem::path& eval_cache,
                                                       const Progress& progress) {
  const RigConfig* rig = known_rig(scene);
  if (!rig) return no_truth(scene);
  const Store store = seen_store(scene, *rig, views, eval_cache);
  std::optional<synth::Truth> truth;
  std::vector<std::vector<ImageMask>> out;
  for (const std::size_t moment : wanted) {
    if (progress) progress(out.size(), wanted.size());
    const int from = moments.fed_from(), shown = moments.shown(moment) + moments.later();
    const std::string name = fmt::format("{}-{}", from, shown);
    const auto bytes = store.get(name);
    auto kept = bytes ? masks_from(*bytes, views) : std::nullopt;
    if (!kept) {
      if (!truth) truth.emplace(*rig, scene.fps);
      kept = look_back(scene, *truth, from, shown, views);
      store.put(name, joined_masks(*kept));
    }
    out.push_back(*std::move(kept));
  }
  if (progress) progress(out.size(), wanted.size());
  return out;
}

}  // namespace mr::eval
