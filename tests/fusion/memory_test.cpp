// A volume that remembers: still surface gets cleaner, moving surface leaves nothing, and only
// chunks that changed beyond the sensor's noise are reported.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>

#include "mr/fusion/marching_cubes.h"
#include "mr/fusion/voxel_volume.h"

namespace mr::fusion {
namespace {

constexpr Precision kPrecision{0.001, 0.0002};
const Vec3d kWallNormal = normalized(Vec3d{-0.2, 0.1, 1});
constexpr double kWallOffset = 2.5;

struct Ball {
  Vec3d middle;
  double radius = 0;
};

Camera camera() {
  Camera c;
  c.width = 240, c.height = 216, c.fx = c.fy = 189, c.cx = 119.5, c.cy = 107.5;
  return c;
}

/// Depth of the wall with a ball before it, noisy, a pixel in a hundred missing.
class Sensor {
 public:
  ImageDepth see(const Ball& ball, double noise = 1) {
    const Camera c = camera();
    ImageDepth depth(c.width, c.height);
    for (int y = 0; y < c.height; ++y)
      for (int x = 0; x < c.width; ++x) {
        const Vec3d ray = unproject(c, {double(x), double(y)});
        double z = kWallOffset / dot(kWallNormal, ray);
        const double a = dot(ray, ray), b = dot(ray, ball.middle);
        const double root = b * b - a * (dot(ball.middle, ball.middle) - ball.radius * ball.radius);
        if (ball.radius > 0 && root > 0) z = std::min(z, (b - std::sqrt(root)) / a);
        z += noise * kPrecision.sigma_m(z) * normal_(random_);
        *depth.at(x, y) = random_() % 100 == 0 ? 0 : static_cast<float>(z);
      }
    return depth;
  }

 private:
  std::mt19937 random_{1};
  std::normal_distribution<double> normal_;
};

VolumeConfig remembering() {
  VolumeConfig config;
  config.history = History::remember;
  config.chunk_m = 0.64;
  return config;
}

void add(const ImageDepth& depth, VoxelVolume& volume) {
  volume.integrate({depth, camera(), Pose{}, {0, 0, depth.width, depth.height}, kPrecision});
}

double off(Vec3f p, const Ball& ball) {
  const Vec3d q = vec_cast<double>(p);
  const double wall = std::abs(dot(kWallNormal, q) - kWallOffset);
  return ball.radius > 0 ? std::min(wall, std::abs(length(q - ball.middle) - ball.radius)) : wall;
}

double rms_m(const Mesh& mesh, const Ball& ball) {
  double sum = 0;
  for (const Vec3f p : mesh.positions) sum += std::pow(off(p, ball), 2);
  return std::sqrt(sum / static_cast<double>(mesh.positions.size()));
}

long count_changes(const std::vector<ChunkChange>& changes, bool ChunkChange::*kind) {
  return std::count_if(changes.begin(), changes.end(),
                       [&](const ChunkChange& c) { return c.*kind; });
}

TEST(Memory, StillSurfaceGetsCleaner) {
  Sensor sensor;
  const Ball ball{{-0.3, 0, 1.6}, 0.35};
  VoxelVolume volume(remembering()), noiseless(remembering());
  add(sensor.see(ball, 0), noiseless);
  const double least_m2 = std::pow(rms_m(extract_surface(noiseless), ball), 2);  // of pixels
  const auto noise_m2 = [&] {
    return std::pow(rms_m(extract_surface(volume), ball), 2) - least_m2;
  };
  add(sensor.see(ball), volume);
  const double first_m2 = noise_m2();
  for (int i = 0; i < 15; ++i) add(sensor.see(ball), volume);
  const double sixteenth_m2 = noise_m2();
  for (int i = 0; i < 24; ++i) add(sensor.see(ball), volume);
  EXPECT_GT(first_m2, least_m2);
  EXPECT_LT(sixteenth_m2, first_m2 / 8);
  EXPECT_LT(noise_m2(), sixteenth_m2);
}

TEST(Memory, StillChunksAreNotReportedAsMoved) {
  Sensor sensor;
  const Ball ball{{-0.3, 0, 1.6}, 0.35};
  VoxelVolume volume(remembering());
  for (int i = 0; i < 3; ++i) add(sensor.see(ball), volume);  // dropouts fill
  const auto fresh = volume.take_changes();
  Surface surface;
  MarchingCubes().run(volume, surface);
  for (const SurfacePiece& piece : surface.pieces)
    EXPECT_TRUE(std::any_of(fresh.begin(), fresh.end(), [&](const ChunkChange& c) {
      return c.cube == piece.cube && c.moved;
    })) << "all are new";
  long refined = 0;
  for (int i = 0; i < 30; ++i) {
    add(sensor.see(ball), volume);
    const auto changes = volume.take_changes();
    EXPECT_EQ(count_changes(changes, &ChunkChange::moved), 0) << "frame " << i;
    refined += count_changes(changes, &ChunkChange::refined);
  }
  // After the 4th and the 16th frame; parts of a chunk may reach them one after another.
  EXPECT_GT(refined, static_cast<long>(volume.chunks().size()));
  EXPECT_LT(refined, 10 * static_cast<long>(volume.chunks().size()));
}

TEST(Memory, MovingSurfaceLeavesNoGhost) {
  Sensor sensor;
  VoxelVolume volume(remembering());
  Ball ball{{-0.45, 0, 1.6}, 0.3};
  for (int i = 0; i < 12; ++i) add(sensor.see(ball), volume);
  volume.take_changes();
  // Sideways, towards the sensor, away from it: the last leaves what was there in plain sight, the
  // second hides it.
  for (const Vec3d step : {Vec3d{0.05, 0, 0}, Vec3d{0, 0, -0.04}, Vec3d{0, 0.01, 0.06}})
    for (int i = 0; i < 8; ++i) {
      ball.middle = ball.middle + step;
      add(sensor.see(ball), volume);
      EXPECT_GT(count_changes(volume.take_changes(), &ChunkChange::moved), 0);
      long far = 0;
      double worst = 0;
      const Mesh mesh = extract_surface(volume);
      for (const Vec3f p : mesh.positions) {
        far += off(p, ball) > 0.03;
        worst = std::max(worst, off(p, ball));
      }
      // Edge pixels that missed by noise; nothing like a sheet.
      EXPECT_LT(far, 60) << "of " << mesh.positions.size();
      EXPECT_LT(worst, 0.06);
    }
}

TEST(Memory, OnlyChunksNearTheMotionChange) {
  Sensor sensor;
  VoxelVolume volume(remembering());
  Ball ball{{-0.4, 0, 1.6}, 0.25};
  for (int i = 0; i < 6; ++i) add(sensor.see(ball), volume);
  volume.take_changes();
  ball.middle.x += 0.08;
  add(sensor.see(ball), volume);
  const auto changes = volume.take_changes();
  ASSERT_GT(count_changes(changes, &ChunkChange::moved), 0);
  EXPECT_LT(count_changes(changes, &ChunkChange::moved),
            static_cast<long>(volume.chunks().size()) / 2);
  for (const ChunkChange& change : changes) {
    if (!change.moved) continue;
    // On the ball's side of the wall; the far side of the picture saw nothing move.
    EXPECT_LT(change.cube.x * 0.64, 0.9) << change.cube.x;
  }
}

TEST(Memory, WhatLeftIsFreedAndReported) {
  Sensor sensor;
  VolumeConfig config = remembering();
  config.patience = 3;
  VoxelVolume volume(config);
  const Ball ball{{-0.3, 0, 1.2}, 0.3};
  for (int i = 0; i < 3; ++i) add(sensor.see(ball), volume);
  volume.take_changes();
  add(sensor.see({}), volume);
  EXPECT_GT(count_changes(volume.take_changes(), &ChunkChange::moved), 0);
  const std::size_t with_both = volume.order().size();
  for (int i = 0; i < 8; ++i) add(sensor.see({}), volume);
  EXPECT_LT(volume.order().size(), with_both);
  VoxelVolume fresh(config);
  for (int i = 0; i < 9; ++i) add(sensor.see({}), fresh);
  EXPECT_NEAR(static_cast<double>(volume.order().size()), static_cast<double>(fresh.order().size()),
              0.05 * fresh.order().size());
}

TEST(Memory, WhoLeavesBeforeNothingLeavesNothing) {
  Sensor sensor;
  VolumeConfig config = remembering();
  config.patience = 4;
  VoxelVolume volume(config);
  const Ball ball{{-0.3, 0, 1.6}, 0.3};
  const auto window = [&](ImageDepth depth) {  // where the ball was seen, nothing is
    const ImageDepth with = sensor.see(ball, 0), without = sensor.see({}, 0);
    for (std::size_t i = 0; i < depth.data.size(); ++i)
      if (with.data[i] < without.data[i] - 0.1f) depth.data[i] = 0;
    return depth;
  };
  for (int i = 0; i < 6; ++i) add(sensor.see(ball), volume);
  for (int i = 0; i < 8; ++i) add(window(sensor.see({})), volume);
  long ghost = 0;
  const Mesh mesh = extract_surface(volume);
  for (const Vec3f p : mesh.positions) ghost += off(p, {}) > 0.05;
  EXPECT_LT(ghost, 20) << "of " << mesh.positions.size();
}

/// Keeps a mesh of every chunk and makes anew only those that are reported.
TEST(Memory, ReportedChunksAreAllThatChange) {
  Sensor sensor;
  VolumeConfig config = remembering();
  config.chunk_m = 0.33;
  VoxelVolume volume(config);
  MarchingCubes marching_cubes;
  std::map<std::array<int, 3>, Mesh> kept;
  for (int i = 0; i < 14; ++i) {
    add(sensor.see({{-0.4 + 0.06 * i, 0, 1.6}, 0.25}), volume);
    for (const ChunkChange& change : volume.take_changes())
      if (change.moved)
        kept[{change.cube.x, change.cube.y, change.cube.z}] =
            marching_cubes.run_chunk(volume, change.cube);
  }
  const Mesh whole = extract_surface(volume);
  double area = 0;
  for (const auto& [cube, mesh] : kept) area += surface_area_m2(mesh);
  EXPECT_NEAR(area, surface_area_m2(whole), 0.02 * surface_area_m2(whole));
}

TEST(Memory, AFlickeringBlackPictureForgetsOnlyAfterAWhile) {
  Sensor sensor;
  VolumeConfig config = remembering();
  config.patience = 5;
  VoxelVolume volume(config);
  add(sensor.see({}), volume);
  const std::size_t vertices = extract_surface(volume).positions.size();
  const ImageDepth black(camera().width, camera().height);
  add(black, volume);
  EXPECT_EQ(extract_surface(volume).positions.size(), vertices);
  volume.take_changes();
  for (int i = 0; i < 6; ++i) add(black, volume);
  EXPECT_TRUE(extract_surface(volume).empty());
  EXPECT_TRUE(volume.order().empty());
  EXPECT_GT(count_changes(volume.take_changes(), &ChunkChange::moved), 0);
}

}  // namespace
}  // namespace mr::fusion
