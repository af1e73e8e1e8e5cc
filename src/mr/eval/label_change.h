#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/core/result.h"
#include "mr/eval/client_run.h"
#include "mr/scene/scene.h"

/// Whether still surface goes on being textured by the same views: where the label of a triangle
/// changes, its colours and its detail jump.
namespace mr::eval {

/// Samples of a surface whose label was compared with that of the capture before.
struct LabelCounts {
  std::uint64_t changed = 0, compared = 0;
};

/// Compares the labels of samples of `now`, spread by area, with those of the nearest points of
/// `before`; samples with nothing within a voxel do not count. `counts`: [T of now] 0 for
/// triangles that are left out; empty: all count.
LabelCounts changed_labels(const Mesh& now, const Mesh& before,
                           std::span<const std::uint8_t> counts, double voxel_m);

/// The share of still area whose label differs from the capture before: the mean over all pairs of
/// consecutive captures. Still area: the chunks of the layer `still` where the stream has some;
/// else what lies nearest to a truth that does not move between the two; without a truth,
/// everything. Nothing: there is no such pair, or no triangle has a view. Errors: those of
/// true_surface().
Result<std::optional<double>> label_change(const Scene& scene,
                                           std::span<const ClientCapture> captures);

}  // namespace mr::eval
