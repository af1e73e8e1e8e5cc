// Parts that no sensor should send: what comes out is a mesh all the same, and soon.
#include <gtest/gtest.h>

#include <chrono>
#include <ctime>

#include "mr/merge/islands.h"
#include "support/merging.h"

namespace mr {
namespace {

using Owner = merge::MergeConfig::Owner;
using Overlap = merge::MergeConfig::Overlap;
using kit::Part;
using merge::OverlapConfig;

struct Odd {
  std::string name;
  std::vector<Part> parts;
};

Part part(Mesh mesh, std::uint32_t sensor = 0, Vec3d eye = {0, 0, 0}, Vec3d target = {0, 0, 2}) {
  return {std::move(mesh), 0.001f, {test::source(sensor, look_at(eye, target, {0, -1, 0}))}};
}

/// A wall of 1.6 m at z = 2, facing -z.
Mesh wall(int cells = 30, float z = 2, float noise_m = 0) {
  return test::grid({-0.8f, 0.8f, z}, {1.6f, 0, 0}, {0, -1.6f, 0}, cells, cells, noise_m);
}

/// Two sensors before a wall; the second sees `mesh`.
std::vector<Part> wall_and(Mesh mesh) {
  return {part(wall(), 0, {-0.2, 0, 0}), part(std::move(mesh), 1, {0.3, 0, 0.2})};
}

/// Two sensors before a wall; the second's camera is changed.
template <typename Change>
std::vector<Part> wall_with(Change&& change) {
  std::vector<Part> parts = wall_and(wall(27, 2.003f, 0.002f));
  change(parts[1].sources[0]);
  return parts;
}

Mesh turned(Mesh mesh) {
  for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

Mesh moved(Mesh mesh, const Pose& T) {
  for (Vec3f& p : mesh.positions) p = vec_cast<float>(T * vec_cast<double>(p));
  return mesh;
}

/// Long thin triangles across the wall, in no order.
Mesh slivers(int count, unsigned seed) {
  std::mt19937 random(seed);
  Mesh mesh;
  for (int i = 0; i < count; ++i) {
    const Vec3f a{1.6f * test::unit(random) - 0.8f, 1.6f * test::unit(random) - 0.8f, 2};
    const float turn = 6.2831853f * test::unit(random);
    const Vec3f along{0.02f * std::cos(turn), 0.02f * std::sin(turn), 0};
    const Vec3f aside{-1e-4f * std::sin(turn), 1e-4f * std::cos(turn), 1e-4f};
    const auto base = static_cast<std::uint32_t>(mesh.positions.size());
    for (const Vec3f p : {a, a + aside, a + along}) mesh.positions.push_back(p);
    mesh.triangles.push_back({base, base + 1, base + 2});
  }
  return mesh;
}

Mesh with_triangles(const std::vector<Triangle>& triangles) {
  Mesh out = wall();
  out.triangles.insert(out.triangles.end(), triangles.begin(), triangles.end());
  return out;
}

/// Three half walls that meet in one upright line.
Mesh pages() {
  Mesh out;
  for (const Vec3f page : {Vec3f{0.8f, 0, 0.1f}, Vec3f{-0.8f, 0, 0.1f}, Vec3f{0, 0, -0.8f}})
    append(out, test::grid({0, 0.8f, 2}, page, {0, -1.6f, 0}, 20, 20));
  return kit::weld(out);
}

/// Blades around one vertex, every third of them doubled.
Mesh fan() {
  Mesh out{{{0, 0, 1.99f}}, {}, {}, {}};
  for (std::uint32_t i = 0; i < 60; ++i) {
    const float turn = -6.2831853f * static_cast<float>(i) / 60;
    out.positions.push_back({0.7f * std::cos(turn), 0.7f * std::sin(turn), 2});
    out.triangles.push_back({0, i + 1, (i + 1) % 60 + 1});
    if (i % 3 == 0) out.triangles.push_back({0, i + 1, (i + 2) % 60 + 1});
  }
  return out;
}

/// A small box around a sensor, facing inwards.
Mesh cell(Vec3f middle, float half) {
  const Vec3f to{half, half, half};
  Mesh mesh = turned(test::box(middle - to, middle + to));
  for (int i = 0; i < 3; ++i)
    mesh = kit::refine(mesh, std::vector<std::uint8_t>(mesh.triangles.size() * 3, 1)).mesh;
  return mesh;
}

std::vector<Odd> odd_parts() {
  std::vector<Odd> out;
  out.push_back({"no parts", {}});
  out.push_back({"one part", {part(wall())}});
  out.push_back({"one empty part", {part({})}});
  out.push_back({"empty parts", {part({}), part({}, 1, {1, 0, 0}), part({}, 2, {-1, 0, 0})}});
  out.push_back({"an empty part", wall_and({})});
  out.push_back({"vertices alone", wall_and({wall().positions, {}, {}, {}})});
  out.push_back(
      {"one triangle", wall_and({{{0, 0, 2}, {0, 0.1f, 2}, {0.1f, 0, 2}}, {{0, 1, 2}}, {}, {}})});
  out.push_back({"identical parts", {part(wall()), part(wall())}});
  out.push_back({"five identical parts",
                 {part(wall()), part(wall()), part(wall()), part(wall()), part(wall())}});
  out.push_back({"coplanar sheets", wall_and(wall(37))});
  out.push_back({"sensors back to back",
                 {part(wall()), part(moved(wall(), {{}, {5, 0, 0}}), 1, {5, 0, 0}, {5, 0, 2})}});
  out.push_back({"a sensor inside a wall",
                 {part(wall()), part(cell({0, 0, 2}, 0.3f), 1, {0, 0, 2}, {0, 0, 3})}});
  out.push_back(
      {"a sensor in the surface", {part(wall()), part(wall(27), 1, {0, 0, 2}, {0, 0, 3})}});
  return out;
}

std::vector<Odd> odd_poses() {
  const Pose beside{{}, {0.5, 0, 0.1}}, far{{}, {1e5, 2e4, -1e5}},
      turn = look_at({0, 0, 0}, {1, 0, 0}, {0, -1, 0});
  std::vector<Odd> out;
  for (const auto& [name, error] : {std::pair("0.5 m beside", beside), std::pair("100 km off", far),
                                    std::pair("90 degrees off", turn)}) {
    out.push_back({name, wall_and(moved(wall(27), error))});
    Pose& T = out.back().parts[1].sources[0].T_world_depth;
    T = error * T;
  }
  out.push_back({"all 100 km off", wall_and(wall(27))});
  for (Part& p : out.back().parts) {
    p.mesh = moved(p.mesh, far);
    p.sources[0].T_world_depth = far * p.sources[0].T_world_depth;
  }
  out.push_back({"a camera 1000 km from its mesh", wall_with([](SourceInfo& s) {
                   s.T_world_depth.translation = {0, 0, -1e6};
                 })});
  out.push_back({"a camera that looks away", wall_with([](SourceInfo& s) {
                   s.T_world_depth = look_at({0, 0, 0}, {0, 0, -2}, {0, -1, 0});
                 })});
  return out;
}

std::vector<Odd> odd_meshes() {
  const Mesh whole = wall(27);
  const std::vector<Triangle>& t = whole.triangles;
  Mesh twice = whole, with_backs = whole, at_odds = whole, one_place = whole, one_line = whole;
  append(twice, whole), append(with_backs, turned(whole));
  for (std::size_t i = 0; i < t.size(); ++i) twice.triangles[t.size() + i] = t[i];
  for (std::size_t i = 0; i < t.size(); ++i)
    with_backs.triangles[t.size() + i] = {t[i][0], t[i][2], t[i][1]};
  for (std::size_t i = 0; i < t.size(); i += 2)
    std::swap(at_odds.triangles[i][0], at_odds.triangles[i][1]);
  for (Vec3f& p : one_place.positions) p = {0, 0, 2};
  for (Vec3f& p : one_line.positions) p = {p.x, 0, 2};
  Mesh soup = wall(8);
  std::mt19937 random(3);
  for (Triangle& corners : soup.triangles)
    for (std::uint32_t& v : corners) v = random() % soup.positions.size();
  Mesh unused = whole;
  unused.positions.insert(unused.positions.begin() + 300, 50, {0, 0, 2});
  for (Triangle& corners : unused.triangles)
    for (std::uint32_t& v : corners) v += v >= 300 ? 50 : 0;
  unused.positions.resize(unused.positions.size() + 1000, {9e8f, -9e8f, 3});
  return {
      {"slivers", wall_and(slivers(3000, 1))},
      {"corners named twice", wall_and(with_triangles({{5, 5, 6}, {7, 8, 8}, {9, 9, 9}}))},
      {"no area", wall_and(with_triangles({{0, 1, 2}, {31, 62, 93}, {0, 30, 15}}))},
      {"all at one place", wall_and(one_place)},
      {"all on one line", wall_and(one_line)},
      {"all twice", wall_and(twice)},
      {"all with their backs", wall_and(with_backs)},
      {"wound at odds", wall_and(at_odds)},
      {"wound the other way", wall_and(turned(whole))},
      {"pages of a book", wall_and(pages())},
      {"two books", {part(pages()), part(pages(), 1, {0.3, 0, 0.2})}},
      {"a fan", wall_and(fan())},
      {"two fans", {part(fan()), part(fan(), 1, {0.3, 0, 0.2})}},
      {"soup", wall_and(soup)},
      {"unused vertices", wall_and(unused)},
      {"tiny", wall_and(moved(whole, {{{1e-20, 0, 0, 0, 1e-20, 0, 0, 0, 1e-20}}, {0, 0, 0}}))},
      {"huge", wall_and(moved(whole, {{{1e2, 0, 0, 0, 1e2, 0, 0, 0, 1e2}}, {0, 0, 0}}))},
  };
}

Camera all_around(CameraModel model) {
  Camera camera;
  camera.model = model;
  camera.width = 256, camera.height = 128;
  if (model != CameraModel::lidar) return camera;
  camera.height = 16;
  for (int row = 0; row < 16; ++row) camera.beam_altitude_rad.push_back(0.26 - 0.035 * row);
  camera.beam_azimuth_rad.assign(16, 0);
  return camera;
}

std::vector<Odd> odd_sources() {
  const auto with = [](auto change) { return wall_with(change); };
  const auto focal = [&](double f) {
    return with([f](SourceInfo& s) { s.depth_camera.fx = s.depth_camera.fy = f; });
  };
  std::vector<Odd> out;
  for (const double f : {1e-3, 8.0, 16000.0, 1e7})
    out.push_back({"a focal length of " + std::to_string(f), focal(f)});
  out.push_back({"one pixel", with([](SourceInfo& s) {
                   s.depth_camera.width = s.depth_camera.height = 1;
                   s.depth_camera.cx = s.depth_camera.cy = 0;
                 })});
  for (const auto& [name, model] : {std::pair("a LiDAR", CameraModel::lidar),
                                    std::pair("all around", CameraModel::equirectangular)})
    out.push_back({name, with([m = model](SourceInfo& s) { s.depth_camera = all_around(m); })});
  out.push_back({"no spread", with([](SourceInfo& s) { s.precision = {0, 0}; })});
  out.push_back({"a spread of metres", with([](SourceInfo& s) { s.precision = {3, 1}; })});
  out.push_back({"twice the same sensor", with([](SourceInfo& s) { s.sensor = SensorId{0}; })});
  out.push_back({"views of no source", wall_and(wall(27, 2.003f))});
  Part& merged = out.back().parts[1];
  merged.sources.push_back(test::source(5, look_at({-0.5, 0, 0}, {0, 0, 2}, {0, -1, 0})));
  std::vector<SensorId> views;
  for (std::size_t i = 0; i < merged.mesh.triangles.size(); ++i)
    views.push_back(i % 3 == 0 ? kNoSensor : SensorId{i % 3 == 1 ? 77u : 5u});
  set_triangle_sensors(merged.mesh, views);
  out.push_back({"an error of metres", wall_and(wall(27, 2.01f))});
  out.back().parts[1].error_m = 4;
  return out;
}

struct Named {
  std::string name;
  OverlapConfig config;
};

std::vector<Named> configs() {
  return {{"coherent", {}},
          {"paper, raster", {.owner = Owner::paper, .overlap = Overlap::raster}},
          {"paper, rays", {.owner = Owner::paper, .overlap = Overlap::rays}}};
}

bool is_manifold(std::span<const Part> parts) {
  return std::all_of(parts.begin(), parts.end(), [](const Part& p) {
    return kit::count_nonmanifold_edges(kit::weld(p.mesh)) == 0 &&
           test::count_doubled_directions(p.mesh) == 0;
  });
}

/// Merges and asks what must hold whatever came in.
test::Merged merged_soundly(std::span<const Part> parts, const OverlapConfig& config) {
  test::Merged out{merge::remove_overlap(parts, config), {}};
  EXPECT_EQ(out.owned.size(), parts.size());
  for (const Mesh& mesh : out.owned) EXPECT_TRUE(test::is_whole(mesh));
  const Mesh zipped = merge::zip(out.owned, merge::zipper_config(config.voxel_m));
  EXPECT_TRUE(test::is_whole(zipped));
  out.mesh = merge::remove_islands(zipped, merge::island_area_m2(config.voxel_m));
  EXPECT_TRUE(test::is_whole(out.mesh));
  if (parts.size() > 1) {
    EXPECT_EQ(kit::count_nonmanifold_edges(out.mesh), 0u);
  }
  if (is_manifold(parts)) {
    EXPECT_EQ(kit::count_nonmanifold_edges(kit::weld(out.mesh)), 0u);
    EXPECT_EQ(test::count_doubled_directions(out.mesh), 0u);
  }
  return out;
}

/// So many parts that those that do not meet are merged apart: some more, near and far, and empty.
std::vector<Part> among_others(std::vector<Part> parts) {
  for (std::uint32_t i = 0; i < 7; ++i) {
    parts.push_back(
        {wall(11, 2.0f + 20.0f * static_cast<float>(i / 3)), 0.001f, {test::source(90 + i, {})}});
    if (i == 5) parts.back().mesh = {};
  }
  return parts;
}

void merge_all(const std::vector<Odd>& all) {
  for (const Odd& odd : all)
    for (const Named& named : configs()) {
      SCOPED_TRACE(odd.name + ", " + named.name);
      merged_soundly(odd.parts, named.config);
      if (named.config.owner == Owner::coherent)
        merged_soundly(among_others(odd.parts), named.config);
    }
}

TEST(MergeBadInput, OddPartsGiveMeshes) { merge_all(odd_parts()); }
TEST(MergeBadInput, OddPosesGiveMeshes) { merge_all(odd_poses()); }
TEST(MergeBadInput, OddMeshesGiveMeshes) { merge_all(odd_meshes()); }
TEST(MergeBadInput, OddSourcesGiveMeshes) { merge_all(odd_sources()); }

TEST(MergeBadInput, OddSettingsGiveMeshes) {
  const std::vector<Part> parts = wall_and(wall(27, 2.004f, 0.002f));
  for (Named& named : configs()) {
    for (const double voxel_m : {0.001, 0.1})
      for (const double calibration_error_m : {0.0, 0.03, 5.0}) {
        named.config.voxel_m = voxel_m;
        named.config.calibration_error_m = calibration_error_m;
        SCOPED_TRACE(named.name + ", " + std::to_string(voxel_m) + ", " +
                     std::to_string(calibration_error_m));
        merged_soundly(parts, named.config);
      }
  }
}

TEST(MergeBadInput, OddGapsGiveMeshes) {
  const std::vector<Mesh> walls = {wall(9), moved(wall(8), {{}, {1.62, 0, 0}})};
  for (const double gap_m : {0.0, 1e-6, 0.06, 2.0})
    for (const double edge_m : {1e-3, 0.025, 10.0}) {
      SCOPED_TRACE(std::to_string(gap_m) + ", " + std::to_string(edge_m));
      const Mesh mesh = merge::zip(walls, {.max_gap_m = gap_m, .edge_m = edge_m});
      EXPECT_TRUE(test::is_whole(mesh));
      EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
    }
}

/// Area that is left of a scene.
double area_left_m2(const std::vector<Part>& parts, const OverlapConfig& config) {
  return surface_area_m2(merged_soundly(parts, config).mesh);
}

const std::vector<Part>& named(const std::vector<Odd>& all, const std::string& name) {
  for (const Odd& odd : all)
    if (odd.name == name) return odd.parts;
  throw std::out_of_range(name);
}

constexpr double kWall_m2 = 1.6 * 1.6;

TEST(MergeBadInput, IdenticalPartsBecomeOne) {
  const auto all = odd_parts();
  for (const char* name : {"identical parts", "five identical parts", "coplanar sheets"})
    for (const Named& n : configs()) {
      SCOPED_TRACE(std::string(name) + ", " + n.name);
      const Mesh mesh = merged_soundly(named(all, name), n.config).mesh;
      EXPECT_NEAR(surface_area_m2(mesh), kWall_m2, 0.02);
      EXPECT_LT(test::doubled_area_share(mesh, 0.02f), 0.005);
      EXPECT_LT(test::openings(named(all, name), mesh, 0.01).missing, 0.005);
    }
}

TEST(MergeBadInput, PartsWithoutOverlapStayWhole) {
  const auto parts = odd_parts(), poses = odd_poses();
  for (const Named& n : configs()) {
    SCOPED_TRACE(n.name);
    EXPECT_NEAR(area_left_m2(named(parts, "sensors back to back"), n.config), 2 * kWall_m2, 1e-3);
    EXPECT_NEAR(area_left_m2(named(parts, "an empty part"), n.config), kWall_m2, 1e-4);
    EXPECT_NEAR(area_left_m2(named(poses, "100 km off"), n.config), 2 * kWall_m2, 0.3);
    EXPECT_NEAR(area_left_m2(named(poses, "90 degrees off"), n.config), 2 * kWall_m2, 0.05);
    const double inside = kWall_m2 + 6 * 0.36;
    EXPECT_NEAR(area_left_m2(named(parts, "a sensor inside a wall"), n.config), inside, 0.4);
  }
}

TEST(MergeBadInput, AWrongPoseTakesNothingFromTheOthers) {
  // The second sensor is half a metre aside and 10 cm behind: what it adds is wrong, but the
  // first one's wall stays whole.
  for (const Named& n : configs()) {
    SCOPED_TRACE(n.name);
    const auto poses = odd_poses();
    const auto& parts = named(poses, "0.5 m beside");
    const auto out = merged_soundly(parts, n.config);
    EXPECT_NEAR(surface_area_m2(out.owned[0]), kWall_m2, 1e-3);
  }
}

TEST(MergeBadInput, OtherWindingIsAnotherSurface) {
  const auto meshes = odd_meshes();
  for (const Named& n : configs()) {
    SCOPED_TRACE(n.name);
    EXPECT_NEAR(area_left_m2(named(meshes, "wound the other way"), n.config), 2 * kWall_m2, 0.05);
  }
}

TEST(MergeBadInput, AroundTheSensorAllBecomesOneLayer) {
  const auto sources = odd_sources();
  for (const char* name : {"a LiDAR", "all around"})
    for (const Named& n : configs()) {
      SCOPED_TRACE(std::string(name) + ", " + n.name);
      const Mesh mesh = merged_soundly(named(sources, name), n.config).mesh;
      EXPECT_LT(test::openings(named(sources, name), mesh, 0.02).missing, 0.005);
      EXPECT_NEAR(surface_area_m2(mesh), kWall_m2, n.config.owner == Owner::paper ? 0.5 : 0.05);
    }
}

TEST(MergeBadInput, UnknownViewsStillLeaveOneLayer) {
  const auto sources = odd_sources();
  const auto& parts = named(sources, "views of no source");
  const Mesh mesh = merged_soundly(parts, {}).mesh;
  EXPECT_LT(test::doubled_area_share(mesh, 0.02f), 0.005);
  EXPECT_LT(test::openings(parts, mesh, 0.02).missing, 0.005);
}

/// Seconds of processor time that all threads together have used.
double processor_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

#if defined(MR_SANITIZED)
constexpr double kSlower = 15;
#else
constexpr double kSlower = 1;
#endif

TEST(MergeBadInput, ManySliversEndSoon) {
  const std::vector<Part> parts = {part(slivers(200'000, 1), 0, {-0.2, 0, 0}),
                                   part(wall(), 1, {0.3, 0, 0.2})};
  const double before_s = processor_s();
  merged_soundly(parts, {});
  EXPECT_LT(processor_s() - before_s, 5 * kSlower);
}

TEST(MergeBadInput, ManySliversOfOneFanEndSoon) {  // a vertex with 40,000 triangles
  Mesh mesh{{{0, 0, 2}}, {}, {}, {}};
  constexpr std::uint32_t kBlades = 40'000;
  for (std::uint32_t i = 0; i < kBlades; ++i) {
    const double turn = -6.283185307 * i / kBlades;
    mesh.positions.push_back(
        {static_cast<float>(0.7 * std::cos(turn)), static_cast<float>(0.7 * std::sin(turn)), 2});
    mesh.triangles.push_back({0, i + 1, (i + 1) % kBlades + 1});
  }
  const std::vector<Part> parts = {part(std::move(mesh), 0, {-0.2, 0, 0}),
                                   part(wall(30, 2.002f), 1, {0.3, 0, 0.2})};
  const double before_s = processor_s();
  merged_soundly(parts, {});
  EXPECT_LT(processor_s() - before_s, 5 * kSlower);
}

TEST(MergeBadInput, ManyIslandsOfOneTriangleEndSoon) {
  const Mesh mesh = slivers(200'000, 4);
  const double before_s = processor_s();
  EXPECT_TRUE(merge::remove_islands(mesh, 0.002).empty());
  EXPECT_EQ(merge::remove_islands(mesh, 0).triangles.size(), mesh.triangles.size());
  EXPECT_LT(processor_s() - before_s, 2 * kSlower);
}

TEST(MergeBadInput, ZippingManySliversEndsSoon) {
  const Mesh halves[] = {slivers(20'000, 4), wall()};
  const double before_s = processor_s();
  const Mesh mesh = merge::zip(halves, merge::zipper_config(0.01));
  EXPECT_LT(processor_s() - before_s, 3 * kSlower);
  EXPECT_TRUE(test::is_whole(mesh));
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
}

TEST(MergeBadInput, AnOddScaleEndsSoon) {  // triangles of 2 km, as a wrong unit makes them
  const Pose larger{{{3e4, 0, 0, 0, 3e4, 0, 0, 0, 3e4}}, {}};
  const std::vector<Part> parts = wall_and(moved(wall(27), larger));
  const double before_s = processor_s();
  merged_soundly(parts, {});
  EXPECT_LT(processor_s() - before_s, 3 * kSlower);
}

/// Strips from one side of the wall to the other, 1.5 mm wide, of slivers: none is an island.
TEST(MergeBadInput, ManyStripsEndSoon) {
  Mesh strips;
  std::mt19937 random(5);
  for (int i = 0; i < 2000; ++i) {
    const float y = 1.6f * test::unit(random) - 0.8f, z = 2 + 0.01f * test::unit(random);
    append(strips, test::grid({-0.8f, y, z}, {1.6f, 0, 0}, {0, -0.0015f, 0}, 20, 1));
  }
  const std::vector<Part> parts = {part(std::move(strips), 0, {-0.2, 0, 0}),
                                   part(wall(30, 2.002f), 1, {0.3, 0, 0.2})};
  const double before_s = processor_s();
  merged_soundly(parts, {});
  EXPECT_LT(processor_s() - before_s, 5 * kSlower);
}

TEST(MergeBadInput, IslandsOfNothingAreNothing) {
  EXPECT_TRUE(merge::remove_islands({}, 0.002).empty());
  EXPECT_TRUE(merge::zip({}, merge::zipper_config(0.01)).empty());
  const Mesh empty[3] = {};
  EXPECT_TRUE(merge::zip(empty, merge::zipper_config(0.01)).empty());
  const Mesh odd{{{0, 0, 0}}, {{0, 0, 0}}, {}, {}};
  EXPECT_TRUE(merge::remove_islands(odd, 1e-9).empty());
}

}  // namespace
}  // namespace mr
