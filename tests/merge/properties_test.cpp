// Merging seen from its documentation: surfaces with known answers, seen by several sensors, and
// what must hold of every merge.
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <tuple>

#include "mr/core/parallel.h"
#include "mr/merge/islands.h"
#include "mr/merge/seam/point_grid.h"
#include "mr/simplify/simplify.h"
#include "support/merging.h"

namespace mr {
namespace {

using Owner = merge::MergeConfig::Owner;
using kit::Part;

struct Case {
  std::string name;
  std::vector<Part> parts;
  double offset_m = 0;
  double apart_m = 0;  ///< of two parts' surfaces, at most
  test::Merged out;
};

/// Decimates every part as a sensor's node does.
std::vector<Part> decimated(std::vector<Part> parts, double ratio) {
  for (Part& part : parts) {
    const auto small =
        simplify::simplify(part.mesh, {.triangles = simplify::triangles_at(part.mesh, ratio)});
    part.mesh = small->mesh, part.error_m = small->error_m;
  }
  return parts;
}

std::vector<Case> make_cases() {
  using test::seen_by;
  std::vector<Case> out;
  const auto add = [&](std::string name, std::vector<Part> parts, double offset_m, double noise_m) {
    out.push_back({std::move(name), std::move(parts), offset_m, offset_m + 2 * noise_m, {}});
  };
  const auto wall = [&](int sensors, float offset_m, float noise_m, int holes = 0) {
    return seen_by(test::wall_shape, test::sensors_before_the_wall(sensors),
                   {.noise_m = noise_m, .offset_m = offset_m, .holes = holes});
  };
  for (const float offset_m : {0.0f, 0.003f, 0.01f})
    for (const int sensors : {2, 3, 4})
      add("wall, " + std::to_string(sensors) + " sensors, " + std::to_string(offset_m),
          wall(sensors, offset_m, 0.002f), offset_m, 0.002);
  add("wall, exact", wall(4, 0, 0), 0, 0);
  add("wall with holes", wall(4, 0.003f, 0.002f, 25), 0.003, 0.002);
  add("decimated wall",
      decimated(seen_by(test::wall_shape, test::sensors_before_the_wall(4),
                        {.cell_m = 0.014f, .noise_m = 0.002f}),
                0.08),
      0, 0.002);
  for (const float offset_m : {0.0f, 0.005f}) {
    const test::CaptureOptions options{.noise_m = 0.001f, .offset_m = offset_m};
    // Noise; chords of what is round; edges that each part's triangles bevel in their own way.
    constexpr double kRound_m = 0.002, kCorner_m = 0.003, kStep_m = 0.005;
    const std::string with = ", " + std::to_string(offset_m);
    add("corner" + with, seen_by(test::corner_shape, test::sensors_in_the_corner(), options),
        offset_m, kCorner_m);
    add("sphere" + with, seen_by(test::sphere_shape, test::sensors_on_six_sides(), options),
        offset_m, kRound_m);
    add("cylinder" + with,
        seen_by(test::cylinder_shape, test::sensors_around(1.8, 0.3, 4), options), offset_m,
        kRound_m);
    add("step" + with, seen_by(test::step_shape, test::sensors_around(1, 1.2, 3), options),
        offset_m, kStep_m);
    add("sheets" + with, seen_by(test::sheets_shape, test::sensors_before_the_wall(2), options),
        offset_m, kRound_m);
    add("table" + with, seen_by(test::table_shape, test::sensors_around(1.2, 1.2, 2), options),
        offset_m, kRound_m);
  }
  return out;
}

/// All scenes and their merges, made once.
const std::vector<Case>& cases() {
  static const std::vector<Case> made = [] {
    std::vector<Case> all = make_cases();
    for (Case& c : all) c.out = test::merged(c.parts);
    return all;
  }();
  return made;
}

double area_m2(const std::vector<Mesh>& meshes) {
  double sum = 0;
  for (const Mesh& m : meshes) sum += surface_area_m2(m);
  return sum;
}

TEST(MergeProperties, ScenesOverlap) {  // or the rest would prove nothing
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    double seen_m2 = 0;
    for (const Part& part : c.parts) seen_m2 += surface_area_m2(part.mesh);
    EXPECT_GT(seen_m2, 1.2 * surface_area_m2(c.out.mesh));
    Mesh all;
    for (const Part& part : c.parts) append(all, part.mesh);
    EXPECT_GT(test::doubled_area_share(all, 0.025f, 500), 0.3);
  }
}

TEST(MergeProperties, OneLayer) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    EXPECT_LT(test::doubled_area_share(c.out.mesh, 0.025f), 0.005);
  }
}

TEST(MergeProperties, NothingIsLost) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const test::Openings open = test::openings(c.parts, c.out.mesh, test::kVoxel_m + c.offset_m);
    EXPECT_LT(open.missing, 0.005);
    EXPECT_LT(open.gaps, 0.001) << "gaps wider than a voxel";
  }
}

TEST(MergeProperties, NoEdgeHasAThirdTriangle) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    EXPECT_EQ(kit::count_nonmanifold_edges(c.out.mesh), 0u);
    EXPECT_EQ(kit::count_nonmanifold_edges(kit::weld(c.out.mesh)), 0u);
    for (const Mesh& mesh : c.out.owned) EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
  }
}

TEST(MergeProperties, NeighboursAreWoundAlike) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    EXPECT_EQ(test::count_doubled_directions(c.out.mesh), 0u);
  }
}

TEST(MergeProperties, NothingIsTurned) {
  const double reach_m = merge::zipper_config(test::kVoxel_m).max_gap_m;
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    EXPECT_EQ(test::count_turned(c.parts, c.out.mesh, reach_m), 0u);
  }
}

TEST(MergeProperties, NoTriangleIsFlat) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    EXPECT_TRUE(test::is_whole(c.out.mesh));
    EXPECT_EQ(test::count_flat(c.out.mesh), 0u);
  }
}

TEST(MergeProperties, VerticesLieBetweenThePartsSurfaces) {
  const double radius_m = merge::zipper_config(test::kVoxel_m).max_gap_m;
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    for (const Mesh& mesh : c.out.owned)
      EXPECT_LT(test::farthest_vertex_m(c.parts, mesh), c.apart_m / 2 + 1e-5)
          << "cut, and moved to between the parts' surfaces";
    EXPECT_LT(test::farthest_vertex_m(c.parts, c.out.mesh), radius_m);
  }
}

TEST(MergeProperties, ZipMovesNoVertex) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const Mesh zipped = merge::zip(c.out.owned, merge::zipper_config(test::kVoxel_m));
    const merge::PointGrid there(zipped.positions, 1e-3);
    std::size_t moved = 0;
    for (const Mesh& mesh : c.out.owned)
      for (const Vec3f p : mesh.positions) {
        bool found = false;
        there.within(p, 1e-7f, [&](std::uint32_t) { found = true; });
        moved += !found;
      }
    EXPECT_EQ(moved, 0u);
  }
}

TEST(MergeProperties, FewerTrianglesThanTheSum) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    std::size_t sum = 0;
    for (const Part& part : c.parts) sum += part.mesh.triangles.size();
    EXPECT_LT(c.out.mesh.triangles.size(), sum);
  }
}

/// How far a point of the wall lies from its outline.
float from_outline_m(Vec3f p) { return std::min(1 - std::abs(p.x), 1 - std::abs(p.y)); }

/// A wall whose outline all sensors see: strips that overlap by half a metre.
std::vector<Part> strips(int count, float offset_m, float noise_m) {
  std::vector<Part> parts;
  const float step = 2 / static_cast<float>(count);
  for (int i = 0; i < count; ++i) {
    const float x0 = std::max(-1.0f, -1 + step * static_cast<float>(i) - 0.25f);
    const float x1 = std::min(1.0f, -1 + step * static_cast<float>(i + 1) + 0.25f);
    const int n = 60 - 7 * i;
    const double x = (x0 + x1) / 2;
    Mesh mesh = test::grid({x0, 1, 2 + offset_m * static_cast<float>(i % 2)}, {x1 - x0, 0, 0},
                           {0, -2, 0}, std::max(8, n / count + 8), n, noise_m, 3 + i);
    parts.push_back({std::move(mesh),
                     0.001f,
                     {test::source(static_cast<std::uint32_t>(i),
                                   look_at({x, 0, -0.2}, {x, 0, 2}, {0, -1, 0}))}});
  }
  return parts;
}

TEST(MergeProperties, TheOutlineStays) {
  for (const int count : {2, 3, 4})
    for (const float offset_m : {0.0f, 0.003f, 0.01f}) {
      SCOPED_TRACE(std::to_string(count) + " sensors, " + std::to_string(offset_m));
      const Mesh mesh = test::merged(strips(count, offset_m, 0.002f)).mesh;
      double length_m = 0, inside_m = 0;
      for (const auto& [a, b] : test::border_of(kit::weld(mesh))) {
        length_m += length(b - a);
        if (from_outline_m((a + b) * 0.5f) > test::kVoxel_m) inside_m += length(b - a);
      }
      EXPECT_NEAR(length_m, 8, 0.1);
      EXPECT_LT(inside_m, 0.02) << "borders of gaps in the wall";
      EXPECT_NEAR(surface_area_m2(mesh), 4, 0.06);  // noise makes it a little larger
    }
}

TEST(MergeProperties, BordersOfOwnershipAreShort) {
  for (const float noise_m : {0.0f, 0.002f, 0.004f})
    for (const float offset_m : {0.0f, 0.004f}) {
      SCOPED_TRACE(std::to_string(noise_m) + ", " + std::to_string(offset_m));
      const auto owned = test::merged(strips(2, offset_m, noise_m)).owned;
      for (const Mesh& mesh : owned) {
        double seam_m = 0;
        for (const auto& [a, b] : test::border_of(mesh))
          if (from_outline_m((a + b) * 0.5f) > test::kVoxel_m) seam_m += length(b - a);
        EXPECT_GT(seam_m, 1.95);
        EXPECT_LT(seam_m, 1.5 * 2);
        EXPECT_EQ(kit::components(mesh).area_m2.size(), 1u) << "kept together";
      }
    }
}

TEST(MergeProperties, OcclusionRuleIsSoundAfterZipping) {
  for (std::size_t i = 0; i < cases().size(); i += 4) {
    const Case& c = cases()[i];
    SCOPED_TRACE(c.name);
    const test::Merged out = test::merged(c.parts, Owner::paper);
    EXPECT_TRUE(test::is_whole(out.mesh));
    EXPECT_EQ(kit::count_nonmanifold_edges(out.mesh), 0u);
    EXPECT_EQ(test::count_doubled_directions(out.mesh), 0u);
    EXPECT_EQ(test::count_flat(out.mesh), 0u);
    EXPECT_LT(test::openings(c.parts, out.mesh, 0.02 + c.offset_m, 300).missing, 0.005)
        << "removal makes no holes";
  }
}

TEST(MergeProperties, SameBytesOnAnyNumberOfThreads) {
  const auto parts =
      test::seen_by(test::wall_shape, test::sensors_before_the_wall(3),
                    {.cell_m = 0.06f, .noise_m = 0.002f, .offset_m = 0.004f, .holes = 12});
  for (const Owner owner : {Owner::coherent, Owner::paper}) {
    std::vector<test::Merged> results;
    for (const int threads : {1, 2, 3, 8}) {
      Arena arena(threads);
      arena.run([&] { results.push_back(test::merged(parts, owner)); });
    }
    for (const test::Merged& other : results) {
      EXPECT_TRUE(other.owned == results[0].owned);
      EXPECT_TRUE(other.mesh == results[0].mesh);
    }
  }
}

TEST(MergeProperties, TheOrderOfPartsDoesNotMatter) {
  for (const std::size_t i : {std::size_t{2}, std::size_t{8}, std::size_t{10}, std::size_t{13}}) {
    const Case& c = cases()[i];
    SCOPED_TRACE(c.name);
    std::vector<Part> reversed(c.parts.rbegin(), c.parts.rend());
    const test::Merged other = test::merged(reversed);
    const double area = surface_area_m2(c.out.mesh);
    EXPECT_NEAR(surface_area_m2(other.mesh), area, 0.01 * area);
    EXPECT_LT(test::two_way_rms_m(c.out.mesh, other.mesh), test::kVoxel_m / 2);
    for (std::size_t k = 0; k < c.parts.size(); ++k)
      EXPECT_NEAR(surface_area_m2(other.owned[c.parts.size() - 1 - k]),
                  surface_area_m2(c.out.owned[k]), 0.01 * area)
          << k;
  }
}

/// A merger's output as the next one takes it: both its sensors, triangles labelled.
Part merged_part(const std::vector<Part>& all, std::size_t first, std::size_t second) {
  const Part pair[] = {all[first], all[second]};
  return {test::merged(pair).mesh, 0.001f, {all[first].sources[0], all[second].sources[0]}};
}

/// Who measured a surface at a point; kNoSensor: several within two voxels, as along a seam.
class Owners {
 public:
  explicit Owners(const Mesh& mesh) : sensors_(triangle_sensors(mesh)), rays_({&mesh}) {}

  SensorId near(Vec3f p) const {
    const SensorId own = at(p);
    for (int i = 0; i < 8; ++i) {
      const float turn = 0.7853982f * static_cast<float>(i), aside = 2 * test::kVoxel_m;
      if (at(p + Vec3f{std::cos(turn), std::sin(turn), 0} * aside) != own) return kNoSensor;
    }
    return own;
  }

 private:
  SensorId at(Vec3f p) const { return sensors_[rays_.scene().nearest(p)->triangle]; }

  std::vector<SensorId> sensors_;
  test::Rays rays_;
};

TEST(MergeProperties, TwoLayersEqualOne) {
  const std::vector<Part> parts =
      test::seen_by(test::wall_shape, test::sensors_before_the_wall(4), {.noise_m = 0.002f});
  const Mesh flat = test::merged(parts).mesh;
  const Part halves[] = {merged_part(parts, 0, 1), merged_part(parts, 2, 3)};
  const Mesh layered = test::merged(halves).mesh;
  EXPECT_LT(test::two_way_rms_m(flat, layered), test::kVoxel_m / 2);
  EXPECT_NEAR(surface_area_m2(layered), surface_area_m2(flat), 0.01 * surface_area_m2(flat));
  EXPECT_EQ(kit::count_nonmanifold_edges(layered), 0u);

  const Owners in_flat(flat), in_layered(layered);
  double alike = 0, differ = 0, strips_met = 0;
  for (const test::SurfacePoint& p : test::points_on(flat, 2000)) {
    const SensorId one = in_flat.near(p.point), two = in_layered.near(p.point);
    if (one == kNoSensor || two == kNoSensor)
      ++strips_met;
    else
      ++(one == two ? alike : differ);
  }
  EXPECT_GT(alike / (alike + differ), 0.99);
  EXPECT_LT(strips_met, 0.15 * (alike + differ));
}

TEST(MergeProperties, SheetsFartherApartThanTheRangeKeepTheirArea) {
  for (const Owner owner : {Owner::coherent, Owner::paper})
    for (const Case& c : cases()) {
      if (c.name.rfind("sheets", 0) != 0) continue;
      SCOPED_TRACE(c.name + (owner == Owner::paper ? ", paper" : ", coherent"));
      // Each sensor misses what the near sheet hides from it; together they see nearly all.
      double near_m2 = 0, far_m2 = 0;
      const Mesh mesh = owner == Owner::paper ? test::merged(c.parts, owner).mesh : c.out.mesh;
      for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
        (mesh.centroid(t).z < 2.05f ? near_m2 : far_m2) += 0.5 * length(mesh.area_normal(t));
      EXPECT_GT(near_m2, 1.94);
      EXPECT_GT(far_m2, 1.9);
      if (owner == Owner::paper) continue;  // a majority leaves some of a frayed border twice
      EXPECT_LT(near_m2, 2.06);
      EXPECT_LT(far_m2, 2.2);
    }
}

TEST(MergeProperties, OverlapRemovalAloneLeavesNoWideGap) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    Mesh all;
    for (const Mesh& mesh : c.out.owned) append(all, mesh);
    EXPECT_LT(test::openings(c.parts, all, 0.03 + c.offset_m, 300).missing, 0.005);
    EXPECT_LT(area_m2(c.out.owned), 1.02 * surface_area_m2(c.out.mesh) + 0.01);
  }
}

TEST(IslandProperties, TheThresholdIsSharpAndByArea) {
  for (const int count : {1, 7, 40}) {  // the same area in many small triangles
    Mesh mesh = test::grid({0, 0, 0}, {0.05f, 0, 0}, {0, 0.04f, 0}, count, count);
    EXPECT_EQ(merge::remove_islands(mesh, 0.002 - 1e-7).triangles.size(), mesh.triangles.size());
    EXPECT_TRUE(merge::remove_islands(mesh, 0.002 + 1e-7).empty());
  }
  EXPECT_NEAR(merge::island_area_m2(0.01), 0.002, 1e-12);
  EXPECT_NEAR(merge::island_area_m2(0.04), 16 * merge::island_area_m2(0.01), 1e-12);
}

TEST(IslandProperties, PiecesAreJoinedByEdges) {
  const Mesh piece = test::grid({0, 0, 0}, {0.04f, 0, 0}, {0, 0.04f, 0}, 4, 4);
  Mesh by_edge = piece, by_vertex = piece;
  append(by_edge, test::grid({0.04f, 0, 0}, {0.04f, 0, 0}, {0, 0.04f, 0}, 4, 4));
  append(by_vertex, test::grid({0.04f, 0.04f, 0}, {0.04f, 0, 0}, {0, 0.04f, 0}, 4, 4));
  const double limit_m2 = 0.002;  // one piece has 0.0016, two 0.0032
  EXPECT_TRUE(merge::remove_islands(piece, limit_m2).empty());
  EXPECT_EQ(merge::remove_islands(kit::weld(by_edge), limit_m2).triangles.size(), 64u);
  EXPECT_TRUE(merge::remove_islands(kit::weld(by_vertex), limit_m2).empty());
}

TEST(IslandProperties, ALargePieceAroundASmallOneKeepsItsViews) {
  Mesh mesh = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 10, 10);
  append(mesh, test::grid({0.4f, 0.4f, 0.1f}, {0.01f, 0, 0}, {0, 0.01f, 0}, 3, 3));
  std::vector<SensorId> views;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) views.push_back(sensor_at(t % 5));
  set_triangle_sensors(mesh, views);
  const Mesh kept = merge::remove_islands(mesh, 0.002);
  EXPECT_EQ(kept.triangles.size(), 200u);
  EXPECT_EQ(kept.positions.size(), 121u);
  std::map<SensorId, int> count;
  for (const SensorId v : triangle_sensors(kept)) ++count[v];
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(count[sensor_at(i)], 40) << i;
}

}  // namespace
}  // namespace mr
