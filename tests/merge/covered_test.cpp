// What any sensor covers stays covered: round things as thin as a limb, seen by several noisy and
// slightly misplaced sensors, through fusion, decimation and merging.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <random>
#include <set>
#include <string>

#include "mr/core/parallel.h"
#include "mr/fusion/clean_depth.h"
#include "mr/fusion/fuse.h"
#include "mr/kit/hole_filling.h"
#include "mr/merge/holes/close_holes.h"
#include "mr/merge/islands.h"
#include "mr/simplify/simplify.h"
#include "mr/synth/person.h"
#include "support/merging.h"

namespace mr {
namespace {

constexpr double kNoise_m = 0.002, kShift_m = 0.003, kTurn_rad = 0.003;
constexpr double kDistance_m = 2;

/// y is down, as in the other tests of merging; about the origin.
Mesh pole() {
  constexpr float kRadius = 0.09f, kHeight = 1;
  constexpr int kAround = 96, kUp = 40;
  Mesh mesh = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, kAround, kUp);
  for (int j = 0; j <= kUp; ++j)
    for (int i = 0; i <= kAround; ++i) {
      const float turn = 2 * std::numbers::pi_v<float> * static_cast<float>(i % kAround) / kAround;
      Vec3f& p = mesh.positions[j * (kAround + 1) + i];
      p = {kRadius * std::cos(turn), kHeight * (p.y - 0.5f), -kRadius * std::sin(turn)};
    }
  return kit::weld(mesh);
}

Mesh ball() { return test::sphere({0, 0, 0}, 0.15f, 64); }

Mesh person() {
  const synth::Body body = synth::make_body(4);
  synth::Walk walk;
  walk.radius = {1e-3, 1e-3}, walk.seed = 4;
  Mesh mesh{synth::pose_body(body, walk, 0.4), body.rest.triangles};
  for (Vec3f& p : mesh.positions) p = {p.x, 0.9f - p.z, p.y};  // z up → y down
  return mesh;
}

/// Two sides, closer together than a voxel.
Mesh sheet() {
  constexpr float kThick = 0.004f;
  Mesh out = test::grid({-0.3f, -0.3f, 0}, {0.6f, 0, 0}, {0, 0.6f, 0}, 40, 40);
  append(out, test::grid({-0.3f, -0.3f, kThick}, {0, 0.6f, 0}, {0.6f, 0, 0}, 40, 40));
  return out;
}

const Mesh& shape(const std::string& name) {
  static const std::map<std::string, Mesh (*)()> makers{
      {"pole", pole}, {"ball", ball}, {"person", person}, {"sheet", sheet}};
  static std::map<std::string, Mesh> made;
  if (!made.contains(name)) made[name] = makers.at(name)();
  return made[name];
}

Camera camera() {
  Camera c;
  c.width = 320, c.height = 320, c.fx = c.fy = 280, c.cx = c.cy = 159.5;
  return c;
}

double gauss(std::mt19937& random) {
  double sum = 0;
  for (int i = 0; i < 12; ++i) sum += test::unit(random);
  return sum - 6;
}

Vec3d direction(std::mt19937& random) {
  return normalized(Vec3d{gauss(random), gauss(random), gauss(random)});
}

/// `T`, a little off.
Pose misplaced(const Pose& T, std::mt19937& random) {
  const Vec3d shift = direction(random) * kShift_m, turn = direction(random) * kTurn_rad;
  Pose out = T;
  for (int i = 0; i < 3; ++i) {
    const Vec3d axis = T.rotation.column(i);
    const Vec3d turned = axis + cross(turn, axis);
    for (int row = 0; row < 3; ++row) out.rotation(row, i) = turned[row];
  }
  const Vec3d x = normalized(out.rotation.column(0));
  const Vec3d z = normalized(cross(x, out.rotation.column(1))), y = cross(z, x);
  for (int row = 0; row < 3; ++row)
    out.rotation(row, 0) = x[row], out.rotation(row, 1) = y[row], out.rotation(row, 2) = z[row];
  out.translation = T.translation + shift;
  return out;
}

fusion::VolumeConfig volume() {
  fusion::VolumeConfig out;
  out.voxel_m = test::kVoxel_m, out.history = fusion::History::none;
  return out;
}

/// What is wrong with a sensor.
struct Fault {
  Vec3d shift;  ///< of its stated pose
  std::function<float(double right, double down, float depth, double chance)>
      measured;  ///< right, down, chance: 0..1
};

void apply(const Fault& fault, std::mt19937& random, ImageDepth& depth) {
  if (!fault.measured) return;
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x)
      if (float& d = *depth.at(x, y); d > 0)
        d = fault.measured(double(x) / depth.width, double(y) / depth.height, d,
                           test::unit(random));
}

/// What a sensor's node makes of a shape.
kit::Part part(const Mesh& truth, std::uint32_t number, Vec3d at, double ratio,
               const Fault& fault) {
  std::mt19937 random(71 + number);
  const Pose T = look_at(at, {0, 0, 0}, {0, -1, 0});
  ImageDepth depth = test::render_depth(truth, camera(), T);
  for (float& d : depth.data)
    if (d > 0) d += static_cast<float>(kNoise_m * gauss(random));
  apply(fault, random, depth);
  const Precision precision{.base_m = kNoise_m, .per_m2 = 0};
  depth = fusion::clean_depth(depth, camera(), precision, {});
  Pose stated = misplaced(T, random);
  stated.translation = stated.translation + fault.shift;
  fusion::FrameFuser fuser(volume());
  Mesh mesh = fuser
                  .fuse({.depth = depth,
                         .camera = camera(),
                         .T_world_camera = stated,
                         .region = {0, 0, depth.width, depth.height},
                         .precision = precision,
                         .slanted = true})
                  .mesh;
  kit::fill_small_holes(mesh, 12 * test::kVoxel_m);
  const auto small = simplify::simplify(mesh, {.triangles = simplify::triangles_at(mesh, ratio)});
  return {merge::remove_islands(small->mesh, merge::island_area_m2(test::kVoxel_m)),
          small->error_m,
          {{SensorId{number}, {}, camera(), stated, precision}}};
}

/// `fault`: of the first sensor.
std::vector<kit::Part> parts(const Mesh& truth, int sensors, double ratio,
                             const Fault& fault = {}) {
  std::vector<kit::Part> out(sensors);
  parallel_for(out.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const double turn = 2 * std::numbers::pi * (static_cast<double>(i) + 0.1) / sensors;
      const Vec3d at{kDistance_m * std::cos(turn), i % 2 == 0 ? -0.6 : -0.2,
                     kDistance_m * std::sin(turn)};
      out[i] = part(truth, static_cast<std::uint32_t>(i), at, ratio, i == 0 ? fault : Fault{});
    }
  });
  return out;
}

/// The nearest distance along a ray to a triangle that faces its start; 0: none.
float front(const std::vector<const Mesh*>& meshes, const kit::RayScene& scene, Vec3f from,
            Vec3f along) {
  std::vector<kit::RayHit> hits;
  scene.all_hits(from, along, 0, 100, hits);
  for (const kit::RayHit& h : hits)
    if (dot(meshes[h.mesh]->area_normal(h.triangle), along) < 0) return h.distance;
  return 0;
}

/// How many meshes a ray meets, on either side.
std::size_t meshes_met(const kit::RayScene& scene, Vec3f from, Vec3f along) {
  std::vector<kit::RayHit> hits;
  scene.all_hits(from, along, 0, 100, hits);
  std::set<std::uint32_t> met;
  for (const kit::RayHit& h : hits) met.insert(h.mesh);
  return met.size();
}

struct RayCount {
  int rays = 0;          ///< that meet a part from outside, and so do their neighbours
  int open = 0;          ///< of these: nothing of the merged surface is there; one sees its inside
  int meet_all = 0;      ///< rays that meet every part
  int pass_through = 0;  ///< of these: that meet nothing of the merged surface at all
  Vec3f example;         ///< where an open one meets a part
};

/// Rays from all around.
RayCount count_rays(std::span<const kit::Part> seen, const Mesh& merged) {
  constexpr float kStep = 0.008f, kReach = 1.1f, kSilhouette = 0.1f, kBehind = 0.06f;
  constexpr int kAside = 3;  // steps
  const std::vector<const Mesh*> of_parts = test::meshes_of(seen), of_merged{&merged};
  const kit::RayScene before(of_parts), after(of_merged);
  Box3f box;
  for (const kit::Part& p : seen)
    for (const Vec3f v : p.mesh.positions) box.add(v);
  RayCount out;
  for (int k = 0; k < 10; ++k) {
    const float turn = 0.6283f * static_cast<float>(k) + 0.2f;
    const Vec3f along = normalized(Vec3f{std::cos(turn), 0.15f, std::sin(turn)});
    const Vec3f right = normalized(cross(along, Vec3f{0, 1, 0})), down = cross(along, right);
    const int n = static_cast<int>(kReach / kStep);
    std::vector<float> there(static_cast<std::size_t>(2 * n + 1) * (2 * n + 1));
    const auto at = [&](int i, int j) -> float& { return there[(j + n) * (2 * n + 1) + i + n]; };
    const auto start = [&](int i, int j) {
      return right * (kStep * static_cast<float>(i)) + down * (kStep * static_cast<float>(j)) -
             along * 5.0f;
    };
    for (int j = -n; j <= n; ++j)
      for (int i = -n; i <= n; ++i) at(i, j) = front(of_parts, before, start(i, j), along);
    for (int j = kAside - n; j <= n - kAside; ++j)
      for (int i = kAside - n; i <= n - kAside; ++i) {
        const float mine = at(i, j);
        bool inner = mine > 0;
        for (const auto& [di, dj] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}})
          for (int s = 1; s <= kAside; ++s)
            inner = inner && at(i + s * di, j + s * dj) > 0 &&
                    std::abs(at(i + s * di, j + s * dj) - mine) < kSilhouette;
        if (!inner) continue;
        ++out.rays;
        if (meshes_met(before, start(i, j), along) == seen.size()) {
          ++out.meet_all;
          out.pass_through += meshes_met(after, start(i, j), along) == 0;
        }
        const float shown = front(of_merged, after, start(i, j), along);
        if (shown > 0 && shown < mine + kBehind) continue;
        ++out.open, out.example = start(i, j) + along * mine;
      }
  }
  return out;
}

class Covered : public testing::TestWithParam<std::tuple<std::string, int, double>> {};

/// Share of the rays that may be open: slits where borders of sheets that lie apart interlock.
/// Without care for what nobody keeps, up to 5 % of the pole's are, and 1 % of the person's.
constexpr double kMostOpen = 0.003;

TEST_P(Covered, WhatSensorsSeeStaysClosed) {
  const auto& [name, sensors, ratio] = GetParam();
  const std::vector<kit::Part> seen = parts(shape(name), sensors, ratio);
  Mesh merged = test::merged(seen).mesh;
  merge::close_holes(merged, seen, {.voxel_m = test::kVoxel_m});
  const RayCount count = count_rays(seen, merged);
  RecordProperty("rays", count.rays);
  RecordProperty("open", count.open);
  RecordProperty("meet_all", count.meet_all);
  ASSERT_GT(count.rays, 4000);
  EXPECT_GT(count.meet_all, 50);
  EXPECT_EQ(count.pass_through, 0) << "of " << count.meet_all;
  EXPECT_LE(count.open, kMostOpen * count.rays)
      << "of " << count.rays << ", one at " << count.example.x << ' ' << count.example.y << ' '
      << count.example.z;
  EXPECT_LT(test::doubled_area_share(merged, 0.025f), 0.1);
}

INSTANTIATE_TEST_SUITE_P(RoundThings, Covered,
                         testing::Combine(testing::Values("pole", "ball", "person"),
                                          testing::Values(2, 3, 4, 5, 6),
                                          testing::Values(1.0, 0.1, 0.05)));

// --- what goes wrong

/// What the other sensors see stays closed.
void expect_no_crater(const std::string& name, const Fault& fault) {
  constexpr int kSensors = 5;
  const std::vector<kit::Part> all = parts(shape(name), kSensors, 0.1, fault);
  Mesh merged = test::merged(all).mesh;
  merge::close_holes(merged, all, {.voxel_m = test::kVoxel_m});
  const RayCount count = count_rays(std::span(all).subspan(1), merged);
  SCOPED_TRACE(name);
  testing::Test::RecordProperty(name + "_open", count.open);
  ASSERT_GT(count.rays, 4000);
  EXPECT_LE(count.open, kMostOpen * count.rays) << "of " << count.rays;
}

TEST(CoveredDespite, ASensorThatIs20CmOff) {
  for (const char* name : {"pole", "ball", "person"})
    expect_no_crater(name, {{0, 0.2, 0}, nullptr});
}

TEST(CoveredDespite, GlassOrAMirrorInFrontOfASensor) {
  const auto mirrored = [](double right, double, float depth, double chance) {
    if (right < 0.45 || right > 0.55) return depth;
    return chance < 0.3 ? 0 : depth + 1.5f;
  };
  for (const char* name : {"pole", "ball", "person"}) expect_no_crater(name, {{}, mirrored});
}

TEST(CoveredDespite, ASensorWithABentDepthField) {
  const auto bent = [](double right, double down, float depth, double) {
    return depth * static_cast<float>(1 + 0.02 * std::sin(6 * right) * std::cos(5 * down));
  };
  for (const char* name : {"pole", "ball", "person"}) expect_no_crater(name, {{}, bent});
}

TEST(CoveredDespite, AThingThinnerThanAVoxel) { expect_no_crater("sheet", {}); }

}  // namespace
}  // namespace mr
