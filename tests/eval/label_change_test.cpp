#include "mr/eval/label_change.h"

#include <gtest/gtest.h>

#include <memory>
#include <utility>
#include <vector>

#include "eval/small_scene.h"
#include "mr/eval/reference_surface.h"
#include "mr/eval/still_error.h"
#include "mr/synth/truth.h"
#include "support/meshes.h"

namespace mr::eval {
namespace {

/// A wall of 4 m², of which the columns from the left on up to `first` (of 20) have view 1, the
/// others view 2.
Mesh wall(int first, float z = 0) {
  Mesh mesh = test::grid({0, 0, z}, {2, 0, 0}, {0, 2, 0}, 20, 20);
  std::vector<ViewId> labels;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    labels.push_back(static_cast<int>(t / 2 % 20) < first ? ViewId{1} : ViewId{2});
  set_triangle_views(mesh, labels);
  return mesh;
}

ClientCapture capture(int number, std::vector<std::pair<Layer, Mesh>> chunks) {
  ClientCapture out{number, {}};
  for (auto& [layer, mesh] : chunks) {
    Chunk chunk;
    chunk.key.id.layer = layer;
    chunk.mesh = std::move(mesh);
    out.scene.chunks.push_back(std::make_shared<const Chunk>(std::move(chunk)));
  }
  return out;
}

std::optional<double> change(const std::vector<ClientCapture>& captures, const Scene& scene = {}) {
  const auto found = label_change(scene, captures);
  if (found) return *found;
  ADD_FAILURE() << found.error().message;
  return std::nullopt;
}

TEST(LabelChange, IsTheShareOfTheArea) {
  const LabelCounts counts = changed_labels(wall(10), wall(7), {}, 0.01);
  EXPECT_EQ(counts.compared, 100'000u);
  EXPECT_NEAR(static_cast<double>(counts.changed), 15'000, 50);  // 3 of 20 columns
  EXPECT_EQ(changed_labels(wall(10), wall(10), {}, 0.01).changed, 0u);
}

TEST(LabelChange, OnlyWhatWasThereBeforeCounts) {
  EXPECT_EQ(changed_labels(wall(20), wall(0, 0.02f), {}, 0.01).compared, 0u);
  EXPECT_EQ(changed_labels(wall(20), wall(0, 0.008f), {}, 0.01).changed, 100'000u);
  std::vector<std::uint8_t> counts(800, 0);
  std::fill_n(counts.begin(), 200, 1);  // a quarter
  EXPECT_NEAR(static_cast<double>(changed_labels(wall(20), wall(0), counts, 0.01).compared), 25'000,
              50);
}

TEST(LabelChange, IsTheMeanOverConsecutiveCaptures) {
  const auto at = [](int number, int first) {
    return capture(number, {{Layer::moving, wall(first)}});
  };
  EXPECT_NEAR(change({at(3, 10), at(4, 10), at(5, 8)}).value(), 0.05, 0.001);
  EXPECT_NEAR(change({at(3, 10), at(5, 0), at(6, 2)}).value(), 0.1, 0.001) << "3 and 5 are no pair";
  EXPECT_EQ(change({at(3, 10)}), std::nullopt);
  EXPECT_EQ(change({at(3, 10), at(5, 0)}), std::nullopt);
}

TEST(LabelChange, LooksAtTheStillLayerWhereThereIsOne) {
  const std::vector<ClientCapture> shown = {
      capture(0, {{Layer::moving, wall(0)}, {Layer::still, wall(10, 1)}}),
      capture(1, {{Layer::moving, wall(20)}, {Layer::still, wall(9, 1)}})};
  EXPECT_NEAR(change(shown).value(), 0.05, 0.001);
}

TEST(LabelChange, NothingWithoutLabels) {
  Mesh bare = wall(3);
  clear_labels(bare);
  EXPECT_EQ(change({capture(0, {{Layer::moving, bare}}), capture(1, {{Layer::moving, bare}})}),
            std::nullopt);
}

TEST(LabelChange, WhatMovesDoesNotCountWithoutAStillLayer) {
  const SmallScene small(", people: 1");
  TrueSurfaces truth(small.scene);
  const Mesh before = *truth.at(0), now = *truth.at(1);
  const auto still = still_triangles(now, before);
  // Everything is labelled anew that moves, and nothing that stays.
  std::vector<ViewId> labels(now.triangles.size(), ViewId{1});
  for (std::size_t t = 0; t < labels.size(); ++t)
    if (!still[t]) labels[t] = ViewId{2};
  Mesh shown = now, shown_before = before;
  set_triangle_views(shown, labels);
  set_view(shown_before, ViewId{1});
  const std::vector<ClientCapture> captures = {capture(0, {{Layer::moving, shown_before}}),
                                               capture(1, {{Layer::moving, shown}})};
  EXPECT_LT(change(captures, small.scene).value(), 1e-4);
  EXPECT_GT(change(captures).value(), 5e-4) << "without a truth everything counts";
}

}  // namespace
}  // namespace mr::eval
