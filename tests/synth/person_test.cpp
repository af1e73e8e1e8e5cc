#include "mr/synth/person.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/synth/gait.h"

namespace mr::synth {
namespace {

constexpr std::array<std::uint64_t, 4> kSeeds{2, 12, 17, 22};

/// Made once for all tests.
const Body& body_of(std::uint64_t seed) {
  static std::map<std::uint64_t, Body> bodies;
  const auto found = bodies.find(seed);
  return found != bodies.end() ? found->second
                               : bodies.emplace(seed, make_body(seed)).first->second;
}

Walk walk_of(std::uint64_t seed) {
  Walk walk;
  walk.center = {0.3, -0.2};
  walk.radius = {1.3, 0.9};
  walk.start_turns = 0.3;
  walk.clockwise = seed % 2 == 1;
  walk.period_s = 10;
  walk.seed = seed;
  return walk;
}

float lowest(const std::vector<Vec3f>& positions) {
  return std::min_element(positions.begin(), positions.end(),
                          [](Vec3f a, Vec3f b) { return a.z < b.z; })
      ->z;
}

float height(const Body& body) {
  float top = 0;
  for (const Vec3f p : body.rest.positions) top = std::max(top, p.z);
  return top;
}

TEST(Person, ArraysFitTogether) {
  for (const auto seed : kSeeds) {
    const Body& body = body_of(seed);
    const std::size_t triangles = body.rest.triangles.size(), vertices = body.rest.positions.size();
    EXPECT_GT(triangles, 30'000u);
    EXPECT_LT(triangles, 66'000u);
    EXPECT_EQ(body.material.size(), triangles);
    EXPECT_EQ(body.surface.size(), triangles);
    EXPECT_EQ(body.surface_m.size(), vertices);
    EXPECT_EQ(body.place.size(), vertices);
    EXPECT_EQ(body.bones.size(), vertices);
    EXPECT_EQ(body.weights.size(), vertices);
    for (const auto m : body.material) ASSERT_LT(m, body.materials.size());
    for (std::size_t v = 0; v < vertices; ++v) {
      ASSERT_TRUE(is_finite(body.rest.positions[v]));
      ASSERT_EQ(body.rest.positions[v], body.rest.positions[body.place[v]]);
      const auto& w = body.weights[v];
      ASSERT_NEAR(w[0] + w[1] + w[2] + w[3], 1, 1e-5);
      for (const float one : w) ASSERT_GE(one, 0);
      for (const auto bone : body.bones[v]) ASSERT_LT(bone, kBones);
    }
  }
}

TEST(Person, EveryPartIsClosedAndWoundOutwards) {
  for (const auto seed : kSeeds) {
    const Body& body = body_of(seed);
    ASSERT_EQ(body.parts.front(), 0u);
    ASSERT_EQ(body.parts.back(), body.rest.triangles.size());
    for (std::size_t part = 0; part + 1 < body.parts.size(); ++part) {
      std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
      double volume = 0;
      for (auto t = body.parts[part]; t < body.parts[part + 1]; ++t) {
        const Triangle& triangle = body.rest.triangles[t];
        ASSERT_GT(length(body.rest.area_normal(t)), 0);
        volume += dot(body.rest.corner(t, 0), body.rest.area_normal(t)) / 6;
        for (int i = 0; i < 3; ++i)
          ASSERT_TRUE(
              edges.insert({body.place[triangle[i]], body.place[triangle[(i + 1) % 3]]}).second)
              << "seed " << seed << " part " << part;
      }
      for (const auto& [from, to] : edges)
        ASSERT_TRUE(edges.contains({to, from})) << "seed " << seed << " part " << part;
      EXPECT_GT(volume, 0);
    }
  }
}

TEST(Person, HasAPersonsHeight) {
  for (const auto seed : kSeeds) {
    const Body& body = body_of(seed);
    EXPECT_GT(height(body), 1.45f);
    EXPECT_LT(height(body), 2.05f);
    EXPECT_NEAR(lowest(body.rest.positions), 0, 0.01f);
  }
}

TEST(Person, SeedsDiffer) {
  EXPECT_NE(height(body_of(2)), height(body_of(12)));
  EXPECT_NE(body_of(2).rest.triangles.size(), body_of(12).rest.triangles.size());
  EXPECT_NE(body_of(2).materials.front().color, body_of(12).materials.front().color);
}

TEST(Person, SameOnAnyNumberOfThreads) {
  std::vector<Body> bodies(2);
  std::vector<std::vector<Vec3f>> posed(2);
  for (const int i : {0, 1})
    Arena(i == 0 ? 1 : 8).run([&] {
      bodies[i] = make_body(12);
      posed[i] = pose_body(bodies[i], walk_of(5), 3.3);
    });
  EXPECT_EQ(bodies[0].rest, bodies[1].rest);
  EXPECT_EQ(bodies[0].weights, bodies[1].weights);
  EXPECT_EQ(posed[0], posed[1]);
}

/// Largest distance between the places of one vertex in two postures.
float farthest(const std::vector<Vec3f>& a, const std::vector<Vec3f>& b) {
  float most = 0;
  for (std::size_t v = 0; v < a.size(); ++v) most = std::max(most, length(a[v] - b[v]));
  return most;
}

TEST(Person, WalkRepeatsAndIsContinuous) {
  constexpr double kFrame_s = 1.0 / 120;
  const Body& body = body_of(12);
  const Walk walk = walk_of(3);
  const auto start = pose_body(body, walk, 0);
  EXPECT_EQ(start, pose_body(body, walk, walk.period_s));
  EXPECT_LT(farthest(start, pose_body(body, walk, walk.period_s - kFrame_s)), 0.05f);
  auto before = start;
  for (int i = 1; i <= 600; ++i) {
    auto now = pose_body(body, walk, i * kFrame_s);
    ASSERT_LT(farthest(before, now), 0.06f) << i * kFrame_s;  // 7 m/s: a quick hand
    before = std::move(now);
  }
}

TEST(Person, StandingFeetStayAndNobodySinks) {
  for (const auto seed : kSeeds) {
    const Body& body = body_of(seed);
    const Walk walk = walk_of(seed);
    std::vector<std::uint32_t> soles[2];
    for (std::uint32_t v = 0; v < body.rest.positions.size(); ++v) {
      const Vec3f p = body.rest.positions[v];
      if (p.z < 0.01f) soles[p.y > 0 ? 0 : 1].push_back(v);
    }
    std::array<int, 2> flat_frames{};
    std::array<std::vector<Vec3f>, 2> landed;
    for (double time = 0; time < walk.period_s; time += 1.0 / 15) {
      const auto now = pose_body(body, walk, time);
      ASSERT_GT(lowest(now), -0.01f) << time;
      ASSERT_LT(lowest(now), 0.01f) << time;
      for (const int side : {0, 1}) {
        if (!foot_is_flat(walk, side, time)) {
          landed[side].clear();
          continue;
        }
        ++flat_frames[side];
        if (landed[side].empty()) landed[side] = now;
        for (const auto v : soles[side]) {
          ASSERT_LT(length(now[v] - landed[side][v]), 0.01f) << time;
          ASSERT_LT(std::abs(now[v].z), 0.015f) << time;
        }
      }
    }
    EXPECT_GT(flat_frames[0], 25);
    EXPECT_GT(flat_frames[1], 25);
  }
}

TEST(Person, SkinIsNotTorn) {
  for (const auto seed : kSeeds) {
    const Body& body = body_of(seed);
    const Walk walk = walk_of(seed + 1);
    for (double time = 0; time < walk.period_s; time += 0.57) {
      const auto now = pose_body(body, walk, time);
      for (std::size_t t = 0; t < body.rest.triangles.size(); ++t) {
        const Triangle& triangle = body.rest.triangles[t];
        float rest = 0, posed = 0;  // longest edges
        for (int i = 0; i < 3; ++i) {
          const auto a = triangle[i], b = triangle[(i + 1) % 3];
          rest = std::max(rest, length(body.rest.positions[a] - body.rest.positions[b]));
          posed = std::max(posed, length(now[a] - now[b]));
        }
        ASSERT_LT(posed, 3 * rest)
            << "seed " << seed << " time " << time << " at " << body.rest.centroid(t).x << ' '
            << body.rest.centroid(t).y << ' ' << body.rest.centroid(t).z;
      }
    }
  }
}

}  // namespace
}  // namespace mr::synth
