#include <gtest/gtest.h>

#include "mr/simplify/simplify.h"
#include "support/decimation.h"

namespace mr {
namespace {

using simplify::Simplified;
using simplify::Simplifier;
using simplify::SimplifyOptions;

std::vector<std::size_t> counts_at(const Mesh& mesh, std::initializer_list<double> ratios) {
  std::vector<std::size_t> out;
  for (const double ratio : ratios) out.push_back(simplify::triangles_at(mesh, ratio));
  return out;
}

std::vector<Simplified> levels_of(const Mesh& mesh, const std::vector<std::size_t>& counts,
                                  const SimplifyOptions& options = {}) {
  auto out = Simplifier().run(mesh, counts, options);
  EXPECT_TRUE(out.ok());
  EXPECT_EQ(out->size(), counts.size());
  return *std::move(out);
}

TEST(SimplifyLevels, AreAsGoodAsSingleRuns) {
  const Mesh mesh = test::hills(160, 120, 0.02f, 0.003f);
  const auto counts = counts_at(mesh, {1, 0.5, 0.25, 0.1, 0.05});
  const std::vector<Simplified> levels = levels_of(mesh, counts);
  EXPECT_TRUE(levels[0].mesh == mesh);
  EXPECT_EQ(levels[0].error_m, 0);
  for (std::size_t i = 1; i < counts.size(); ++i) {
    SCOPED_TRACE(counts[i]);
    EXPECT_TRUE(test::is_sound(levels[i].mesh));
    EXPECT_NEAR(static_cast<double>(levels[i].mesh.triangles.size()),
                static_cast<double>(counts[i]), 0.01 * static_cast<double>(counts[i]));
    const auto single = simplify::simplify(mesh, {.triangles = counts[i]});
    EXPECT_LT(test::two_sided_rms_m(mesh, levels[i].mesh),
              1.05 * test::two_sided_rms_m(mesh, single->mesh));
    EXPECT_GE(levels[i].error_m, levels[i - 1].error_m);
  }
}

TEST(SimplifyLevels, FirstLevelIsThatOfASingleRun) {
  const Mesh mesh = test::hills(160, 120, 0.02f, 0.003f);
  const auto counts = counts_at(mesh, {0.3, 0.1});
  const auto single = simplify::simplify(mesh, {.triangles = counts[0]});
  const std::vector<Simplified> levels = levels_of(mesh, counts);
  EXPECT_TRUE(levels[0].mesh == single->mesh);
  EXPECT_EQ(levels[0].error_m, single->error_m);
}

/// Edges between triangles of different chunks, as places.
std::set<std::pair<Vec3f, Vec3f>> chunk_edges(const Simplified& level) {
  std::map<test::Edge, std::set<std::uint32_t>> sides;
  for (std::size_t t = 0; t < level.chunks.size(); ++t) {
    const Triangle& c = level.mesh.triangles[t];
    for (std::size_t i = 0; i < 3; ++i)
      sides[std::minmax(c[i], c[(i + 1) % 3])].insert(level.chunks[t]);
  }
  std::set<std::pair<Vec3f, Vec3f>> out;
  for (const auto& [edge, chunks] : sides)
    if (chunks.size() > 1)
      out.insert(std::minmax(level.mesh.positions[edge.first], level.mesh.positions[edge.second]));
  return out;
}

TEST(SimplifyLevels, ChunkLinesAreTheSameInAll) {
  const Mesh mesh = test::hills(160, 120, 0.02f, 0.003f);
  const std::vector<std::uint32_t> chunks = test::chunks_by_cube(mesh, 1);
  const auto counts = counts_at(mesh, {1, 0.5, 0.25, 0.1, 0.05});
  const std::vector<Simplified> levels = levels_of(mesh, counts, {.chunks = chunks});
  const auto lines = chunk_edges(levels[0]);
  EXPECT_GT(lines.size(), 50u);
  EXPECT_LT(lines.size(), chunk_edges({mesh, chunks, {}, 0}).size());
  for (std::size_t i = 0; i < levels.size(); ++i) {
    EXPECT_TRUE(chunk_edges(levels[i]) == lines) << i;
    EXPECT_LE(levels[i].mesh.triangles.size(), counts[i]);
    if (i == 0) continue;
    EXPECT_GE(static_cast<double>(levels[i].mesh.triangles.size()),
              0.99 * static_cast<double>(counts[i]));
  }
}

TEST(SimplifyLevels, StopAtTheErrorAndTakeAnyCounts) {
  const Mesh mesh = test::hills(80, 60, 0.02f, 0.003f);
  const std::vector<Simplified> levels =
      levels_of(mesh, {mesh.triangles.size() * 2, 4000, 4000, 10, 0}, {.error_m = 0.003f});
  EXPECT_TRUE(levels[0].mesh == mesh);
  EXPECT_EQ(levels[1].mesh.triangles.size(), levels[2].mesh.triangles.size());
  EXPECT_GT(levels[3].mesh.triangles.size(), 10u);
  for (const Simplified& level : levels) EXPECT_LE(level.error_m, 1.001f * 0.003f);
  EXPECT_TRUE(levels_of(mesh, {}).empty());
  for (const Simplified& level : levels_of({}, {5, 0})) EXPECT_TRUE(level.mesh.empty());
}

}  // namespace
}  // namespace mr
