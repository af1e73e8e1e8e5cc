#include "mr/eval/viewpoints.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <sstream>

#include "mr/core/parallel.h"
#include "mr/eval/floor_map.h"
#include "mr/eval/skeleton.h"
#include "mr/kit/raster.h"
#include "support/meshes.h"

namespace mr::eval {
namespace {

using Json = nlohmann::json;
using Path = std::filesystem::path;

constexpr Vec3d kUp{0, 0, 1};

// --- places with known floor plans

/// A wall from a to b that is seen from its left.
Mesh wall(Vec2f a, Vec2f b, float height) {
  const Vec3f foot{b.x, b.y, 0};
  return test::grid(foot, Vec3f{a.x, a.y, 0} - foot, {0, 0, height}, 20, 10);
}

Mesh floor_between(Vec2f low, Vec2f high) {
  return test::grid({low.x, low.y, 0}, {high.x - low.x, 0, 0}, {0, high.y - low.y, 0}, 40, 40);
}

/// Walls along a counter-clockwise outline, which so face inwards.
void add_walls(Mesh& mesh, const std::vector<Vec2f>& outline, float height = 2.5f) {
  for (std::size_t i = 0; i < outline.size(); ++i)
    append(mesh, wall(outline[i], outline[(i + 1) % outline.size()], height));
}

Mesh room(float width, float depth) {
  Mesh mesh = floor_between({0, 0}, {width, depth});
  add_walls(mesh, {{0, 0}, {width, 0}, {width, depth}, {0, depth}});
  return mesh;
}

/// Arms 6 m and 5 m long, 2 m wide, along x and y.
Mesh corner_corridor() {
  Mesh mesh = floor_between({0, 0}, {6, 2});
  append(mesh, floor_between({0, 2}, {2, 5}));
  add_walls(mesh, {{0, 0}, {6, 0}, {6, 2}, {2, 2}, {2, 5}, {0, 5}});
  return mesh;
}

std::vector<Pose> corner_sensors(double width, double depth) {
  std::vector<Pose> out;
  const Vec3d middle{width / 2, depth / 2, 1};
  for (const Vec3d eye : {Vec3d{0.3, 0.3, 2}, {width - 0.3, 0.3, 2}, {0.3, depth - 0.3, 2}})
    out.push_back(look_at(eye, middle, kUp));
  return out;
}

ViewPlan plan_of(const Mesh& mesh, std::span<const Pose> sensors, Vec3d up = kUp,
                 const ViewpointConfig& config = {}) {
  auto plan = plan_viewpoints(mesh, sensors, up, config);
  if (plan) return *plan;
  ADD_FAILURE() << plan.error().message;
  return {};
}

std::vector<Vec3d> skeleton_points(const FloorMap& map) {
  std::vector<Vec3d> out;
  for (std::size_t i = 0; i < map.skeleton.size(); ++i)
    if (map.skeleton[i]) out.push_back(world_point(map, static_cast<std::int32_t>(i), 0));
  return out;
}

bool has_near(const std::vector<Vec3d>& points, Vec3d p, double within_m) {
  return std::any_of(points.begin(), points.end(),
                     [&](Vec3d q) { return std::hypot(p.x - q.x, p.y - q.y) <= within_m; });
}

float clearance_at(const FloorMap& map, Vec3d p_world) {
  const Vec3d p = map.T_world_floor.inverse() * p_world;
  const int x = static_cast<int>(std::floor(p.x / map.cell_m));
  const int y = static_cast<int>(std::floor(p.y / map.cell_m));
  if (x < 0 || y < 0 || x >= map.width || y >= map.height) return -1;
  return map.clearance_m[static_cast<std::size_t>(y) * map.width + x];
}

/// What every viewpoint of a room must keep to.
void expect_good_views(const ViewPlan& plan, const Mesh& mesh) {
  for (std::size_t i = 0; i < plan.views.size(); ++i) {
    const render::Viewpoint& view = plan.views[i];
    SCOPED_TRACE(view.name);
    EXPECT_EQ(view.name, (i < 10 ? "view-0" : "view-") + std::to_string(i));
    EXPECT_EQ(view.camera.width, 960);
    EXPECT_EQ(view.camera.height, 720);
    EXPECT_NEAR(2 * std::atan(360 / view.camera.fy) * 180 / std::numbers::pi, 60, 1e-9);
    EXPECT_GE(clearance_at(plan.floor, view.T_world_camera.translation), 0.4f - 1e-4f);
    const double height = (plan.floor.T_world_floor.inverse() * view.T_world_camera.translation).z;
    EXPECT_TRUE(std::abs(height - 1.2) < 1e-9 || std::abs(height - 1.65) < 1e-9) << height;
    const Vec3d up = plan.floor.T_world_floor.rotation.column(2);
    EXPECT_NEAR(dot(view.T_world_camera.rotation.column(0), up), 0, 1e-9) << "rolled";
    const auto raster = kit::rasterize(mesh, picture_camera(240, 180, 60), view.T_world_camera);
    std::vector<float> depths;
    for (const float d : raster.depth.data)
      if (d > 0) depths.push_back(d);
    EXPECT_GE(depths.size(), 0.24 * 240 * 180);
    if (depths.empty()) continue;
    std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
    EXPECT_GE(depths[depths.size() / 2], 0.49f);
  }
}

TEST(Viewpoints, EmptyRoomHasItsMedialAxis) {
  const Mesh mesh = room(6, 4);
  const auto sensors = corner_sensors(6, 4);
  const ViewPlan plan = plan_of(mesh, sensors);
  EXPECT_EQ(plan.kind, ViewPlan::Kind::voronoi);
  const auto skeleton = skeleton_points(plan.floor);
  for (double x = 2; x <= 4; x += 0.1) EXPECT_TRUE(has_near(skeleton, {x, 2, 0}, 0.08)) << x;
  for (double d = 0.5; d < 2; d += 0.1) {  // from the corners, at equal distance to two walls
    EXPECT_TRUE(has_near(skeleton, {d, d, 0}, 0.1)) << d;
    EXPECT_TRUE(has_near(skeleton, {6 - d, 4 - d, 0}, 0.1)) << d;
  }
  for (const Vec3d p : skeleton) {  // and nothing else
    const double to_side = std::min(p.y, 4 - p.y), to_end = std::min(p.x, 6 - p.x);
    EXPECT_TRUE(std::abs(to_side - 2) < 0.1 || std::abs(to_side - to_end) < 0.15)
        << p.x << ' ' << p.y;
  }
  EXPECT_EQ(plan.views.size(), 30u);
  expect_good_views(plan, mesh);
  for (const auto& view : plan.views) {
    const Vec3d eye = view.T_world_camera.translation;
    EXPECT_TRUE(eye.x > 0.4 && eye.x < 5.6 && eye.y > 0.4 && eye.y < 3.6);
  }
}

TEST(Viewpoints, SkeletonGoesRoundABlock) {
  Mesh mesh = room(7, 6);
  append(mesh, test::box({2.5f, 2, 0}, {4.5f, 4, 1.5f}));
  const auto sensors = corner_sensors(7, 6);
  const ViewPlan plan = plan_of(mesh, sensors);
  const auto skeleton = skeleton_points(plan.floor);
  for (const Vec3d p : {Vec3d{1.25, 3, 0}, {5.75, 3, 0}, {3.5, 1, 0}, {3.5, 5, 0}})
    EXPECT_TRUE(has_near(skeleton, p, 0.1)) << p.x << ' ' << p.y;
  EXPECT_FALSE(has_near(skeleton, {3.5, 3, 0}, 1.3));
  EXPECT_EQ(plan.views.size(), 30u);
  expect_good_views(plan, mesh);
  bool sides[4]{};  // somebody stands on each side of the block
  for (const auto& view : plan.views) {
    const Vec3d eye = view.T_world_camera.translation;
    sides[0] |= eye.x<2.5, sides[1] |= eye.x> 4.5, sides[2] |= eye.y<2, sides[3] |= eye.y> 4;
  }
  EXPECT_TRUE(sides[0] && sides[1] && sides[2] && sides[3]);
}

TEST(Viewpoints, LowAndHighThingsAreNotInTheWay) {
  Mesh mesh = room(6, 4);
  append(mesh, test::box({2, 1, 0}, {4, 3, 0.2f}));     // a carpet
  append(mesh, test::box({2, 1, 1.9f}, {4, 3, 2.2f}));  // a lamp
  const ViewPlan plan = plan_of(mesh, corner_sensors(6, 4));
  EXPECT_TRUE(has_near(skeleton_points(plan.floor), {3, 2, 0}, 0.1));
}

TEST(Viewpoints, CorridorRoundACorner) {
  const Mesh mesh = corner_corridor();
  const std::vector<Pose> sensors{look_at({5.8, 1, 2}, {0, 1, 1}, kUp),
                                  look_at({1, 4.8, 2}, {1, 0, 1}, kUp)};
  const ViewPlan plan = plan_of(mesh, sensors);
  const auto skeleton = skeleton_points(plan.floor);
  for (double along = 2.3; along < 4; along += 0.2) {
    EXPECT_TRUE(has_near(skeleton, {along, 1, 0}, 0.1)) << along;
    EXPECT_TRUE(has_near(skeleton, {1, along, 0}, 0.1)) << along;
  }
  for (const Vec3d p : skeleton)  // not in the hull's other half, behind the walls
    EXPECT_TRUE(p.x < 2 || p.y < 2) << p.x << ' ' << p.y;
  EXPECT_GE(plan.views.size(), 20u);
  expect_good_views(plan, mesh);
}

TEST(Viewpoints, NoiseBelowTheFloorDoesNotCount) {
  Mesh mesh = room(6, 4);
  append(mesh, test::grid({1, 1, -1.5f}, {0.5f, 0, 0}, {0, 0.5f, 0}, 4, 4));
  EXPECT_NEAR(floor_height_m(mesh, kUp), 0, 0.01);
  append(mesh, test::grid({1, 1, 0.75f}, {2, 0, 0}, {0, 2, 0}, 4, 4));  // a table
  EXPECT_NEAR(floor_height_m(mesh, kUp), 0, 0.01);
  EXPECT_NEAR(floor_height_m(test::grid({0, 0, 0.3f}, {5, 0, 0}, {0, 5, 0}, 30, 30, 0.02f), kUp),
              0.3, 0.01);
}

TEST(Viewpoints, FloorOfAPlaceWhereNothingFacesUp) {
  EXPECT_NEAR(floor_height_m(wall({0, 0}, {4, 0}, 2.5f), kUp), 0.05, 0.15);
}

/// The same room, turned: y is up, and the world is turned about it.
TEST(Viewpoints, PlanTurnsWithTheWorld) {
  Mesh mesh = room(7, 5);
  append(mesh, test::box({2, 2, 0}, {4, 3, 1.5f}));
  const auto sensors = corner_sensors(7, 5);
  const double a = 0.6;
  const Mat3 turn{{std::cos(a), 0, std::sin(a), 0, 1, 0, -std::sin(a), 0, std::cos(a)}};
  const Mat3 y_up{{0, 1, 0, 0, 0, 1, 1, 0, 0}};
  const Pose T{turn * y_up, {3, -2, 1}};
  Mesh turned = mesh;
  for (Vec3f& p : turned.positions) p = vec_cast<float>(T * vec_cast<double>(p));
  std::vector<Pose> turned_sensors;
  for (const Pose& sensor : sensors) turned_sensors.push_back(T * sensor);
  const ViewPlan plan = plan_of(mesh, sensors);
  const ViewPlan other = plan_of(turned, turned_sensors, {0, 1, 0});
  EXPECT_NEAR(other.floor.T_world_floor.translation.y, -2, 0.01);
  expect_good_views(other, turned);
  EXPECT_EQ(other.views.size(), plan.views.size());
  const auto ours = skeleton_points(plan.floor);
  std::vector<Vec3d> theirs;
  for (const Vec3d p : skeleton_points(other.floor)) theirs.push_back(T.inverse() * p);
  int far = 0;
  for (const Vec3d p : theirs) far += !has_near(ours, p, 0.15);
  for (const Vec3d p : ours) far += !has_near(theirs, p, 0.15);
  EXPECT_LT(far, 0.05 * static_cast<double>(ours.size() + theirs.size()));
}

/// Two rooms with a wall between them, both with sensors: one may not be enough.
TEST(Viewpoints, SmallerPartsHelpOutWhereTheLargestGivesTooFew) {
  Mesh mesh = room(2.1f, 1.5f);
  Mesh other = room(1.9f, 1.5f);
  for (Vec3f& p : other.positions) p.x += 2.2f;
  append(mesh, other);
  const std::vector<Pose> sensors{look_at({0.2, 0.2, 2}, {1, 1, 0.5}, kUp),
                                  look_at({3.9, 0.2, 2}, {3, 1, 0.5}, kUp)};
  const auto views_in = [&](int views, bool first) {
    ViewpointConfig config;
    config.views = views;
    const ViewPlan plan = plan_of(mesh, sensors, kUp, config);
    return std::count_if(plan.views.begin(), plan.views.end(), [&](const auto& view) {
      return (view.T_world_camera.translation.x < 2.15) == first;
    });
  };
  EXPECT_EQ(views_in(4, true), 4);
  EXPECT_EQ(views_in(4, false), 0) << "the largest part was enough";
  EXPECT_GT(views_in(100, true), 4);
  EXPECT_GT(views_in(100, false), 4);
}

// --- arcs

std::vector<Pose> four_around(Vec3d middle, double radius) {
  std::vector<Pose> out;
  for (int i = 0; i < 4; ++i) {
    const double turn = std::numbers::pi * (0.1 + 0.5 * i);
    const Vec3d eye = middle + Vec3d{std::cos(turn), std::sin(turn), 0.5} * radius;
    out.push_back(look_at(eye, middle, kUp));
  }
  return out;
}

TEST(Viewpoints, SmallThingIsSeenFromArcsBetweenTheSensors) {
  const Vec3d middle{1, 2, 0.8};
  const auto sensors = four_around(middle, 1.2);
  const ViewPlan plan = plan_of(test::sphere(vec_cast<float>(middle), 0.35f, 24), sensors);
  EXPECT_EQ(plan.kind, ViewPlan::Kind::arcs);
  EXPECT_TRUE(plan.floor.cells.empty());
  EXPECT_EQ(plan.views.size(), 30u);
  bool quarters[4]{};
  for (const auto& view : plan.views) {
    const Vec3d away = view.T_world_camera.translation - middle;
    EXPECT_LT(length(away), 1.2 * 1.2);
    EXPECT_GT(length(away), 0.5 + 0.35);
    EXPECT_GT(away.z, 0) << "as the sensors, from above";
    EXPECT_GT(dot(view.T_world_camera.rotation.column(2), -normalized(away)), 0.999);
    quarters[(away.x > 0) + 2 * (away.y > 0)] = true;
  }
  EXPECT_TRUE(quarters[0] && quarters[1] && quarters[2] && quarters[3]);
}

TEST(Viewpoints, OneSensorAndOneFromStraightAbove) {
  const Mesh ball = test::sphere({0, 0, 0}, 0.35f, 24);
  const std::vector<Pose> one{look_at({1.2, 0, 0.3}, {0, 0, 0}, kUp)};
  EXPECT_GT(plan_of(ball, one).views.size(), 1u);
  const std::vector<Pose> above{look_at({0, 0, 1.2}, {0, 0, 0}, {1, 0, 0})};
  const ViewPlan plan = plan_of(ball, above);
  ASSERT_FALSE(plan.views.empty());
  EXPECT_NEAR(plan.views[0].T_world_camera.rotation.column(2).z, -1, 1e-9);
}

TEST(Viewpoints, TooLittleToSeeIsAnError) {
  const auto cause = [](const Result<ViewPlan>& result) {
    return result ? std::string("none") : std::string(cause_name(result.error().cause));
  };
  const auto sensors = four_around({0, 0, 0}, 3);
  EXPECT_EQ(cause(plan_viewpoints({}, sensors, kUp)), "empty");
  const Mesh speck = test::sphere({0, 0, 0}, 0.02f, 8);
  EXPECT_EQ(cause(plan_viewpoints(speck, sensors, kUp)), "empty");
  EXPECT_EQ(cause(plan_viewpoints(test::sphere({0, 0, 0}, 0.4f, 8), {}, kUp)), "empty");
  Mesh line;
  line.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  line.triangles = {{0, 1, 2}};
  EXPECT_EQ(cause(plan_viewpoints(line, sensors, kUp)), "empty");
  Mesh broken = room(4, 4);
  broken.positions[7].y = std::nanf("");
  EXPECT_EQ(cause(plan_viewpoints(broken, sensors, kUp)), "invalid");
  EXPECT_EQ(
      cause(plan_viewpoints(test::grid({0, 0, 0}, {300, 0, 0}, {0, 300, 0}, 4, 4), sensors, kUp)),
      "too_large");
}

// --- the parts

TEST(NearestSeed, IsExact) {
  constexpr int kWidth = 37, kHeight = 23;
  for (unsigned seed = 1; seed < 8; ++seed) {
    std::mt19937 random(seed);
    std::vector<std::uint8_t> seeds(kWidth * kHeight);
    for (auto& s : seeds) s = random() % (seed * seed * 10) == 0;
    seeds[random() % seeds.size()] = 1;
    const auto nearest = nearest_seed(seeds, kWidth, kHeight);
    const auto square = [](std::int32_t a, std::int32_t b) {
      const int dx = a % kWidth - b % kWidth, dy = a / kWidth - b / kWidth;
      return dx * dx + dy * dy;
    };
    for (std::int32_t cell = 0; cell < kWidth * kHeight; ++cell) {
      int least = std::numeric_limits<int>::max();
      for (std::int32_t s = 0; s < kWidth * kHeight; ++s)
        if (seeds[s]) least = std::min(least, square(cell, s));
      ASSERT_GE(nearest[cell], 0);
      ASSERT_TRUE(seeds[nearest[cell]]);
      ASSERT_EQ(square(cell, nearest[cell]), least) << seed << ' ' << cell;
    }
  }
  const auto none = nearest_seed(std::vector<std::uint8_t>(12), 4, 3);
  EXPECT_EQ(std::count(none.begin(), none.end(), -1), 12);
}

TEST(ConvexHull, KeepsTheCorners) {
  std::vector<Vec2d> points;
  for (int y = 0; y <= 4; ++y)
    for (int x = 0; x <= 6; ++x) points.push_back({x * 0.5, y * 0.5});
  const std::vector<Vec2d> expected{{0, 0}, {3, 0}, {3, 2}, {0, 2}};
  EXPECT_EQ(convex_hull(points), expected);
  EXPECT_EQ(convex_hull({{1, 1}, {1, 1}}).size(), 1u);
  EXPECT_EQ(convex_hull({{0, 0}, {1, 1}, {2, 2}}).size(), 2u);
}

/// Random blocks: every loop of the walkable area stays, and the skeleton is one cell thin.
TEST(Skeleton, IsThinAndKeepsTheLoops) {
  std::mt19937 random(3);
  FloorMap map;
  map.width = 120, map.height = 90;
  map.cells.assign(120 * 90, FloorMap::free);
  for (int y = 0; y < 90; ++y)
    for (int x = 0; x < 120; ++x)
      if (x < 2 || y < 2 || x > 117 || y > 87) map.cells[y * 120 + x] = FloorMap::unknown;
  for (int i = 0; i < 5; ++i) {
    const int left = 22 + 18 * i, top = 25 + static_cast<int>(random() % 30);
    for (int y = top; y < top + 6; ++y)
      for (int x = left; x < left + 4; ++x) map.cells[y * 120 + x] = FloorMap::obstacle;
  }
  find_skeleton(map, 0.2);
  const auto parts = components(map);
  ASSERT_EQ(parts.size(), 1u) << "connected";
  int squares = 0, corners = 0, links = 0;  // Euler's number of an 8-connected picture
  for (int y = 0; y < 89; ++y)
    for (int x = 0; x < 119; ++x) {
      const auto at = [&](int dx, int dy) { return map.skeleton[(y + dy) * 120 + x + dx]; };
      const int sum = at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1);
      squares += sum == 4, corners += sum == 1, links += sum == 3;
      links += sum == 2 && at(0, 0) == at(1, 1) ? 2 : 0;
    }
  EXPECT_EQ((corners - links) / 4, 1 - 5) << "one part with a loop round each of five blocks";
  EXPECT_EQ(squares, 0) << "thin";
  for (const std::int32_t cell : parts[0]) EXPECT_GE(map.clearance_m[cell], 0.2f - 1e-6f);
}

// --- files

class ViewpointsFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        std::filesystem::temp_directory_path() / ("viewpoints_test_" + std::to_string(::getpid()));
    std::filesystem::create_directory(folder_);
    plan_ = plan_of(test::sphere({0, 0, 0}, 0.35f, 16), four_around({0, 0, 0}, 1.1));
    ASSERT_TRUE(write_viewpoints(file(), plan_, "key"));
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  Path file() const { return folder_ / "views.json"; }
  std::string text() const {
    std::ostringstream out;
    out << std::ifstream(file()).rdbuf();
    return out.str();
  }
  Result<ViewPlan> read(const std::string& written, const std::string& key = "key") const {
    std::ofstream(file()) << written;
    return read_viewpoints(file(), key);
  }
  std::string cause_of(const std::string& written) const {
    const auto plan = read(written);
    if (plan) return "none";
    EXPECT_NE(plan.error().message.find("views.json"), std::string::npos) << plan.error().message;
    return cause_name(plan.error().cause);
  }

  Path folder_;
  ViewPlan plan_;
};

TEST_F(ViewpointsFile, ComesBackAsItWas) {
  const auto back = read_viewpoints(file(), "key");
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->kind, plan_.kind);
  ASSERT_EQ(back->views.size(), plan_.views.size());
  for (std::size_t i = 0; i < plan_.views.size(); ++i) {
    EXPECT_EQ(back->views[i].name, plan_.views[i].name);
    EXPECT_EQ(back->views[i].camera, plan_.views[i].camera);
    EXPECT_EQ(back->views[i].T_world_camera, plan_.views[i].T_world_camera);
  }
  EXPECT_TRUE(read_viewpoints(file(), ""));
}

TEST_F(ViewpointsFile, RefusesWhatWasPlannedForSomethingElse) {
  const auto other = read_viewpoints(file(), "other");
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().cause, Error::Cause::invalid);
  const auto missing = read_viewpoints(folder_ / "missing.json", "key");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().cause, Error::Cause::not_found);
}

TEST_F(ViewpointsFile, RefusesDamage) {
  const std::string good = text();
  EXPECT_EQ(cause_of(good), "none");
  EXPECT_EQ(cause_of(""), "corrupt");
  EXPECT_EQ(cause_of("[]"), "corrupt");
  EXPECT_EQ(cause_of(good.substr(0, good.size() / 2)), "corrupt");
  EXPECT_EQ(cause_of(std::string(9 << 20, ' ')), "too_large");
  const auto changed = [&](const auto& change) {
    Json json = Json::parse(good);
    change(json);
    return cause_of(json.dump());
  };
  const Json pose = Json::parse(good)["views"][3]["T_world_camera"];
  EXPECT_EQ(changed([](Json& j) { j["version"] = 2; }), "unsupported");
  EXPECT_EQ(changed([](Json& j) { j["format"] = "gltf"; }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j.erase("key"); }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["kind"] = "spiral"; }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["picture"] = {0, 720}; }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["picture"] = {960, 1e9}; }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["picture"] = {960, 18446744073709551615ull}; }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["vertical_fov_deg"] = 180; }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["vertical_fov_deg"] = "60"; }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["views"] = Json::array(); }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["views"] = Json::object(); }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["views"] = Json::array_t(10'001, j["views"][0]); }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["views"][3] = 5; }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["views"][3]["name"] = "a\nb"; }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["views"][3]["name"] = std::string(65, 'a'); }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["views"][3]["T_world_camera"][16] = 1; }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["views"][3]["T_world_camera"][3] = nullptr; }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["views"][3]["T_world_camera"][0] = 3; }), "corrupt");
  EXPECT_EQ(changed([](Json& j) { j["views"][3]["T_world_camera"][12] = 1; }), "corrupt");
  EXPECT_EQ(cause_of(std::string(100'000, '[')), "corrupt");
  std::string infinite = good;
  infinite.replace(infinite.find("1.0"), 3, "1e999");
  EXPECT_EQ(cause_of(infinite), "corrupt");
}

TEST_F(ViewpointsFile, LeavesNothingBehindOnFailure) {
  EXPECT_FALSE(write_viewpoints(folder_ / "nowhere" / "views.json", plan_, "key"));
  EXPECT_FALSE(write_viewpoints(folder_ / "other.json", {}, "key"));
  ViewPlan mixed = plan_;
  mixed.views[1].camera.fx += 1;
  EXPECT_FALSE(write_viewpoints(folder_ / "other.json", mixed, "key"));
  EXPECT_FALSE(write_viewpoints(folder_ / "other.json", plan_, "\xff\xfe"));
  int files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder_)) ++files;
  EXPECT_EQ(files, 1);
}

TEST_F(ViewpointsFile, OneAndEightThreadsWriteTheSameBytes) {
  Mesh mesh = room(6, 5);
  append(mesh, test::box({2, 2, 0}, {3.5f, 3, 1.5f}));
  const auto with = [&](int threads) {
    Arena(threads).run(
        [&] { ASSERT_TRUE(write_viewpoints(file(), plan_of(mesh, corner_sensors(6, 5)), "k")); });
    return text();
  };
  const std::string one = with(1);
  EXPECT_GT(one.size(), 5000u);
  EXPECT_EQ(with(8), one);
}

// --- pictures

std::size_t count_of(const std::string& text, const std::string& word) {
  std::size_t count = 0;
  for (auto at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++count;
  return count;
}

TEST(PlanPicture, ShowsViewsSensorsAndLegend) {
  const auto sensors = corner_sensors(6, 4);
  const ViewPlan plan = plan_of(room(6, 4), sensors);
  const std::string svg = draw_plan_svg(plan, sensors);
  EXPECT_EQ(count_of(svg, "<polygon"), sensors.size() + 1) << "and one in the legend";
  EXPECT_EQ(count_of(svg, "<circle"), plan.views.size() + 2);
  EXPECT_EQ(count_of(svg, "paint-order"), plan.views.size());
  for (const char* words : {">29</text>", ">skeleton</text>", ">obstacle</text>", "1 m</text>"})
    EXPECT_EQ(count_of(svg, words), 1u) << words;
  EXPECT_EQ(count_of(svg, "<svg"), 1u);
  EXPECT_EQ(count_of(svg, "</svg>"), 1u);
  EXPECT_EQ(count_of(svg, "nan"), 0u);
}

TEST(PlanPicture, OfArcsHasNoFloor) {
  const auto sensors = four_around({0, 0, 0}, 1.1);
  const ViewPlan plan = plan_of(test::sphere({0, 0, 0}, 0.35f, 16), sensors);
  const std::string svg = draw_plan_svg(plan, sensors);
  EXPECT_EQ(count_of(svg, "<polygon"), 5u);
  EXPECT_EQ(count_of(svg, "skeleton"), 0u);
  EXPECT_EQ(count_of(svg, "paint-order"), plan.views.size());
  EXPECT_EQ(count_of(draw_plan_svg({}, {}), "</svg>"), 1u);
}

}  // namespace
}  // namespace mr::eval
