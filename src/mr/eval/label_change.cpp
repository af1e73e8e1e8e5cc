#include "mr/eval/label_change.h"

#include <algorithm>
#include <map>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/eval/geometry_error.h"
#include "mr/eval/reference_surface.h"
#include "mr/eval/still_error.h"
#include "mr/kit/raycast.h"

namespace mr::eval {
namespace {

constexpr int kLabelSamples = 100'000;

bool has_still_layer(const DecodedScene& scene) {
  return std::ranges::any_of(scene.chunks,
                             [](const auto& chunk) { return chunk->key.id.layer == Layer::still; });
}

/// The labelled chunks of a layer, or of both.
Mesh labelled(const DecodedScene& scene, bool only_still) {
  Mesh out;
  for (const auto& chunk : scene.chunks)
    if (!chunk->mesh.views.empty() && (!only_still || chunk->key.id.layer == Layer::still))
      append(out, chunk->mesh);
  return out;
}

/// For each triangle whether the nearest truth is the same in both captures.
std::vector<std::uint8_t> near_still_truth(const Mesh& mesh, const Mesh& truth,
                                           const Mesh& truth_before) {
  const std::vector<std::uint8_t> still = still_triangles(truth, truth_before);
  const kit::RayScene rays(std::vector<const Mesh*>{&truth});
  std::vector<std::uint8_t> out(mesh.triangles.size());
  parallel_for(out.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const auto nearest = rays.nearest(mesh.centroid(t));
      out[t] = nearest && still[nearest->triangle];
    }
  });
  return out;
}

}  // namespace

LabelCounts changed_labels(const Mesh& now, const Mesh& before,
                           std::span<const std::uint8_t> counts, double voxel_m) {
  const auto samples = sample_surface(now, kLabelSamples, 1);
  const std::vector<ViewId> labels = triangle_views(now), old = triangle_views(before);
  const kit::RayScene rays(std::vector<const Mesh*>{&before});
  enum : std::uint8_t { left_out, same, different };
  std::vector<std::uint8_t> found(samples.size(), left_out);
  parallel_for(samples.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t t = samples[i].triangle;
      if (!counts.empty() && !counts[t]) continue;
      const auto nearest = rays.nearest(samples[i].position, static_cast<float>(voxel_m));
      if (nearest) found[i] = labels[t] == old[nearest->triangle] ? same : different;
    }
  });
  LabelCounts out;
  for (const std::uint8_t one : found)
    out.compared += one != left_out, out.changed += one == different;
  return out;
}

Result<std::optional<double>> label_change(const Scene& scene,
                                           std::span<const ClientCapture> captures) {
  TrueSurfaces truth(scene);
  std::map<int, Mesh> surfaces;  // of the truth, by capture
  double sum = 0;
  int pairs = 0;
  for (std::size_t i = 1; i < captures.size(); ++i) {
    const ClientCapture &now = captures[i], &before = captures[i - 1];
    if (now.capture != before.capture + 1) continue;
    const bool layers = has_still_layer(now.scene);
    const Mesh shown = labelled(now.scene, layers);
    std::vector<std::uint8_t> counts;
    if (!layers && has_true_surface(scene)) {
      for (const int capture : {before.capture, now.capture}) {
        if (surfaces.contains(capture)) continue;
        auto surface = truth.at(capture);
        if (!surface) return surface.error();
        surfaces[capture] = *std::move(surface);
      }
      counts = near_still_truth(shown, surfaces[now.capture], surfaces[before.capture]);
      surfaces.erase(before.capture);
    }
    const LabelCounts found =
        changed_labels(shown, labelled(before.scene, layers), counts, scene.voxel_m);
    if (found.compared == 0) continue;
    sum += static_cast<double>(found.changed) / static_cast<double>(found.compared), ++pairs;
  }
  return pairs > 0 ? std::optional(sum / pairs) : std::nullopt;
}

}  // namespace mr::eval
