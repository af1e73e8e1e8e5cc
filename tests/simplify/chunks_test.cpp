#include <gtest/gtest.h>

#include "mr/simplify/simplify.h"
#include "support/decimation.h"

namespace mr {
namespace {

using simplify::Simplified;
using simplify::Simplifier;
using simplify::SimplifyOptions;

using Levels = std::vector<Simplified>;
using Places = std::pair<Vec3f, Vec3f>;  // an edge by the places of its ends, lower first
using ChunkPair = std::pair<std::uint32_t, std::uint32_t>;
using Lines = std::map<ChunkPair, std::set<Places>>;

/// A scene and what its triangles belong to.
struct Chunked {
  Mesh mesh;
  std::vector<std::uint32_t> chunks;
};

Levels levels_of(const Chunked& scene, float border_error_m = 0.0025f,
                 const std::vector<double>& ratios = {1.0, 0.5, 0.25, 0.15}) {
  std::vector<std::size_t> counts;
  for (const double ratio : ratios) counts.push_back(simplify::triangles_at(scene.mesh, ratio));
  auto out = Simplifier().run(scene.mesh, counts,
                              {.chunks = scene.chunks, .border_error_m = border_error_m});
  EXPECT_TRUE(out.ok());
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const Simplified& level = (*out)[i];
    EXPECT_TRUE(test::is_sound(level.mesh));
    EXPECT_EQ(level.chunks.size(), level.mesh.triangles.size());
    if (i == 0) continue;  // lines only
    EXPECT_GE(static_cast<double>(level.mesh.triangles.size()),
              0.99 * static_cast<double>(counts[i]));
  }
  return *std::move(out);
}

/// Edges that triangles of two chunks share.
Lines lines_of(const Mesh& mesh, const std::vector<std::uint32_t>& chunks) {
  std::map<test::Edge, std::set<std::uint32_t>> sides;
  for (std::size_t t = 0; t < chunks.size(); ++t)
    for (std::size_t i = 0; i < 3; ++i)
      sides[std::minmax(mesh.triangles[t][i], mesh.triangles[t][(i + 1) % 3])].insert(chunks[t]);
  Lines out;
  for (const auto& [edge, at] : sides)
    if (at.size() == 2)
      out[{*at.begin(), *at.rbegin()}].insert(
          std::minmax(mesh.positions[edge.first], mesh.positions[edge.second]));
  return out;
}
Lines lines_of(const Simplified& level) { return lines_of(level.mesh, level.chunks); }

/// A ball; its lines run in zigzag.
Chunked chunked_ball() {
  const Mesh mesh = test::sphere({0.013f, 0.021f, 0.017f}, 1, 80);
  return {mesh, test::chunks_by_cube(mesh, 0.5f)};
}
/// Hills through several layers of cubes: zigzag where they meet, straight elsewhere.
Chunked chunked_hills(unsigned seed = 1) {
  const Mesh mesh = test::hills(150, 100, 0.02f, 0.003f, seed);
  return {mesh, test::chunks_by_cube(mesh, 0.5f)};
}
/// Hills in one layer of cubes: all lines lie along rows and columns.
Chunked chunked_flat_hills(unsigned seed = 1) {
  Mesh mesh = test::hills(150, 100, 0.02f, 0.003f, seed);
  for (Vec3f& p : mesh.positions) p.z = 0.5f * p.z + 0.25f;
  return {mesh, test::chunks_by_cube(mesh, 0.5f)};
}

/// Takes each chunk from any level of any version, and welds what lies at the same place.
Mesh mixed(const std::vector<const Levels*>& versions, unsigned seed) {
  std::mt19937 random(seed);
  std::map<std::uint32_t, const Simplified*> chosen;
  for (const Levels* levels : versions)
    for (const std::uint32_t chunk : levels->front().chunks)
      if (!chosen.contains(chunk)) {
        const Levels& from = *versions[random() % versions.size()];
        chosen[chunk] = &from[random() % from.size()];
      }
  Mesh out;
  for (const Levels* levels : versions)
    for (const Simplified& level : *levels) {
      std::vector<std::uint8_t> keep;
      for (const std::uint32_t chunk : level.chunks) keep.push_back(chosen.at(chunk) == &level);
      append(out, select_triangles(level.mesh, keep));
    }
  return kit::weld(out);
}

/// Edges of one triangle that do not lie along the outline of [0, 3] x [0, 2] m.
std::size_t open_edges_inside(const Mesh& mesh) {
  std::size_t open = 0;
  for (const auto& [edge, uses] : test::edges_of(mesh)) {
    if (uses != 1) continue;
    const Vec3f a = mesh.positions[edge.first], b = mesh.positions[edge.second];
    const auto both = [](float s, float t, float at) {
      return std::abs(s - at) < 1e-4f && std::abs(t - at) < 1e-4f;
    };
    open += !both(a.x, b.x, 0) && !both(a.x, b.x, 3) && !both(a.y, b.y, 0) && !both(a.y, b.y, 2);
  }
  return open;
}

TEST(SimplifyChunks, LevelsOfABallMixWithoutAGap) {
  const Levels levels = levels_of(chunked_ball());
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Mesh mix = mixed({&levels}, seed);
    EXPECT_EQ(kit::count_boundary_edges(mix), 0u) << seed;
    EXPECT_EQ(kit::count_nonmanifold_edges(mix), 0u) << seed;
    EXPECT_EQ(test::euler_characteristic(mix), 2) << seed;
  }
}

TEST(SimplifyChunks, LevelsOfHillsMixWithoutAGap) {
  for (const Chunked& scene : {chunked_hills(), chunked_flat_hills()}) {
    const Levels levels = levels_of(scene);
    for (unsigned seed = 1; seed <= 20; ++seed) {
      const Mesh mix = mixed({&levels}, seed);
      EXPECT_EQ(open_edges_inside(mix), 0u) << seed;
      EXPECT_EQ(kit::count_nonmanifold_edges(mix), 0u) << seed;
    }
  }
}

TEST(SimplifyChunks, SmallChunksMixWithoutAGap) {
  for (const float edge_m : {0.1f, 0.17f}) {
    Chunked scene{test::hills(150, 100, 0.02f, 0.003f), {}};
    scene.chunks = test::chunks_by_cube(scene.mesh, edge_m);
    // No fewer: where lines leave no choice, even the outline's corners would go.
    const Levels levels = levels_of(scene, 0.01f, {1.0, 0.7, 0.5, 0.4});
    for (unsigned seed = 1; seed <= 10; ++seed) {
      const Mesh mix = mixed({&levels}, seed);
      EXPECT_EQ(open_edges_inside(mix), 0u) << edge_m << ' ' << seed;
      EXPECT_EQ(kit::count_nonmanifold_edges(mix), 0u) << edge_m << ' ' << seed;
    }
  }
}

TEST(SimplifyChunks, EachKeepsItsPartOfTheSurface) {
  const Chunked scene = chunked_flat_hills();
  const auto area_m2 = [](const Mesh& mesh, const std::vector<std::uint32_t>& chunks) {
    std::map<std::uint32_t, double> out;  // seen from above
    for (std::size_t t = 0; t < chunks.size(); ++t) out[chunks[t]] += mesh.area_normal(t).z / 2;
    return out;
  };
  const auto before = area_m2(scene.mesh, scene.chunks);
  for (const Simplified& level : levels_of(scene)) {
    const auto after = area_m2(level.mesh, level.chunks);
    ASSERT_EQ(after.size(), before.size());
    for (const auto& [chunk, area] : before) EXPECT_NEAR(after.at(chunk), area, 0.001 * area);
  }
}

/// The vertices that lie farther than `margin_m` from every line, given other noise, in every other
/// chunk; and all vertices have other numbers.
Chunked changed_inside(const Chunked& scene, float margin_m) {
  std::vector<Vec3f> on_lines;
  for (const auto& [pair, edges] : lines_of(scene.mesh, scene.chunks))
    for (const auto& [a, b] : edges) on_lines.push_back(a), on_lines.push_back(b);
  std::vector<std::uint8_t> changes(scene.mesh.positions.size(), 0);
  for (std::size_t t = 0; t < scene.chunks.size(); ++t)
    for (const std::uint32_t v : scene.mesh.triangles[t]) changes[v] = scene.chunks[t] % 2;
  Mesh mesh = scene.mesh;
  std::mt19937 random(9);
  for (std::size_t v = 0; v < changes.size(); ++v) {
    for (const Vec3f p : on_lines)
      if (length(p - mesh.positions[v]) < margin_m) changes[v] = 0;
    if (changes[v]) mesh.positions[v].z += 0.004f * (static_cast<float>(random() % 256) / 255);
  }
  const std::size_t vertices = mesh.positions.size(), shift = vertices / 3;
  std::rotate(mesh.positions.begin(), mesh.positions.begin() + static_cast<std::ptrdiff_t>(shift),
              mesh.positions.end());
  for (Triangle& t : mesh.triangles)
    for (std::uint32_t& v : t) v = static_cast<std::uint32_t>((v + vertices - shift) % vertices);
  EXPECT_GT(std::count(changes.begin(), changes.end(), 1), 2000);
  return {mesh, scene.chunks};
}

TEST(SimplifyChunks, VersionsThatDifferInsideMixWithoutAGap) {
  for (const Chunked& scene : {chunked_flat_hills(), chunked_hills()}) {
    const Chunked other = changed_inside(scene, 0.1f);
    const Levels before = levels_of(scene), after = levels_of(other);
    ASSERT_FALSE(before[2].mesh == after[2].mesh);
    EXPECT_TRUE(lines_of(before[0]) == lines_of(after[0]));
    for (unsigned seed = 1; seed <= 20; ++seed) {
      const Mesh mix = mixed({&before, &after}, seed);
      EXPECT_EQ(kit::count_nonmanifold_edges(mix), 0u) << seed;
      EXPECT_EQ(open_edges_inside(mix), 0u) << seed;
    }
  }
}

TEST(SimplifyChunks, LinesDependOnTheirOwnVerticesAlone) {
  for (const Chunked& scene : {chunked_flat_hills(), chunked_hills()}) {
    const Chunked other = changed_inside(scene, 0.001f);  // up to the lines
    EXPECT_TRUE(lines_of(levels_of(scene)[0]) == lines_of(levels_of(other)[0]));
  }
}

TEST(SimplifyChunks, AChangeAtALineIsOneOfBothItsChunksAlone) {
  const Chunked scene = chunked_flat_hills();
  const Lines original = lines_of(scene.mesh, scene.chunks);
  const Lines before = lines_of(levels_of(scene)[0]);
  int tried = 0;
  for (const auto& [pair, edges] : original) {
    if (edges.size() < 20 || ++tried % 5 != 0) continue;
    const Vec3f at = std::next(edges.begin(), 12)->first;  // amid the line
    Chunked other = scene;
    for (Vec3f& p : other.mesh.positions)
      if (p == at) p.z += 0.03f;
    const Lines after = lines_of(levels_of(other)[0]);
    ASSERT_EQ(after.size(), before.size());
    for (const auto& [which, line] : before)
      EXPECT_EQ(after.at(which) == line, which != pair) << which.first << ' ' << which.second;
  }
  EXPECT_GE(tried, 10);
}

TEST(SimplifyChunks, LinesStayWithinTheirError) {
  for (const Chunked& scene : {chunked_ball(), chunked_hills(), chunked_flat_hills()})
    for (const float error_m : {0.0f, 0.001f, 0.005f, 0.02f}) {
      SCOPED_TRACE(error_m);
      const Lines before = lines_of(scene.mesh, scene.chunks);
      const Lines after = lines_of(levels_of(scene, error_m)[0]);
      std::size_t edges_before = 0, edges_after = 0;
      double worst_m = 0;
      for (const auto& [pair, edges] : before) {
        ASSERT_TRUE(after.contains(pair));
        edges_before += edges.size(), edges_after += after.at(pair).size();
        for (const auto& [p, unused] : edges) {
          double least_m = 1;
          for (const auto& [a, b] : after.at(pair))
            least_m = std::min(
                least_m, length(vec_cast<double>(p) -
                                kit::nearest_on_segment(vec_cast<double>(p), vec_cast<double>(a),
                                                        vec_cast<double>(b))));
          worst_m = std::max(worst_m, least_m);
        }
      }
      EXPECT_LE(worst_m, error_m + 1e-6);
      if (error_m < 0.005f) continue;
      EXPECT_LT(edges_after, edges_before * 3 / 4);
    }
}

/// A fan hangs on the middle of one side of a square chunk: the chunk's line begins and ends there.
TEST(SimplifyChunks, WhereALineBeginsAndEndsStays) {
  Chunked scene{test::grid({0, 0, 0}, {8, 0, 0}, {0, 8, 0}, 8, 8), {}};
  for (std::size_t t = 0; t < scene.mesh.triangles.size(); ++t) {
    const Vec3f middle = scene.mesh.centroid(t);
    scene.chunks.push_back(middle.x > 2 && middle.x < 6 && middle.y > 2 && middle.y < 6 ? 1 : 0);
  }
  const Vec3f hinge{4, 2, 0};
  const auto at = static_cast<std::uint32_t>(std::ranges::find(scene.mesh.positions, hinge) -
                                             scene.mesh.positions.begin());
  const auto next = static_cast<std::uint32_t>(scene.mesh.positions.size());
  for (const Vec3f p : {Vec3f{4, 2, 1}, Vec3f{5, 2, 1}}) scene.mesh.positions.push_back(p);
  scene.mesh.triangles.push_back({at, next, next + 1}), scene.chunks.push_back(0);
  for (const Simplified& level : levels_of(scene, 0.1f, {1.0, 0.5})) {
    EXPECT_EQ(std::ranges::count(level.mesh.positions, hinge), 1);
    std::size_t uses = 0;
    for (const auto& [pair, edges] : lines_of(level))
      for (const Places& edge : edges) uses += edge.first == hinge || edge.second == hinge;
    EXPECT_EQ(uses, 2u) << "the line still passes it";
  }
}

TEST(SimplifyChunks, ThatMeetNowhereChangeNothing) {
  Mesh mesh = test::sphere({0, 0, 0}, 1, 40);
  std::vector<std::uint32_t> chunks(mesh.triangles.size(), 7);
  append(mesh, test::sphere({5, 0, 0}, 1, 40));
  chunks.resize(mesh.triangles.size(), 1000000000);
  const auto with = simplify::simplify(mesh, {.triangles = 1000, .chunks = chunks});
  const auto without = simplify::simplify(mesh, {.triangles = 1000});
  EXPECT_TRUE(with->mesh == without->mesh);
  for (std::size_t t = 0; t < with->chunks.size(); ++t)
    EXPECT_EQ(with->chunks[t], with->mesh.centroid(t).x < 2.5f ? 7u : 1000000000u);
}

}  // namespace
}  // namespace mr
