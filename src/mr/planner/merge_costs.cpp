#include "mr/planner/merge_costs.h"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "mr/codec/mesh_codec.h"
#include "mr/core/coding_plan.h"
#include "mr/core/parallel.h"
#include "mr/core/trace.h"
#include "mr/merge/merge_surfaces.h"
#include "mr/node/chunk_grid.h"

namespace mr::planner {
namespace {

constexpr int kParts = 4;
constexpr float kWidthM = 3.2f, kHeightM = 2.6f;  // of a wall
constexpr int kRuns = 3;                          // of each measurement, or fewer that take
constexpr double kEnoughMs = 200;                 // so long together

/// The picture of a Kinect with as many pixels as the scene's first sensor.
Camera camera_of(const Scene& scene) {
  Camera camera;
  camera.width = 640, camera.height = 576;
  if (!scene.sensors.empty() && scene.sensors[0].depth_camera.model == CameraModel::pinhole)
    camera.width = scene.sensors[0].depth_camera.width,
    camera.height = scene.sensors[0].depth_camera.height;
  camera.fx = camera.fy = 0.65 * camera.width;  // 75 degrees
  camera.cx = (camera.width - 1) / 2.0, camera.cy = (camera.height - 1) / 2.0;
  return camera;
}

/// A wall with ripples and noise, 2.5 m before a sensor at (x_m, 0, 0).
Mesh wall(std::uint32_t sensor, float x_m, double triangles) {
  const auto columns = static_cast<std::uint32_t>(std::sqrt(triangles / 2 * kWidthM / kHeightM));
  const auto rows = static_cast<std::uint32_t>(triangles / 2 / columns);
  Mesh out;
  for (std::uint32_t y = 0; y <= rows; ++y)
    for (std::uint32_t x = 0; x <= columns; ++x) {
      const float right = kWidthM * (static_cast<float>(x) / static_cast<float>(columns) - 0.5f);
      const float down = kHeightM * (static_cast<float>(y) / static_cast<float>(rows) - 0.5f);
      const std::uint64_t random =
          hash_cell(vec_cast<std::int32_t>(Vec3<std::uint32_t>{x, y, sensor}));
      const float noise_m = 0.004f * (static_cast<float>(random >> 40) / 16777216.0f - 0.5f);
      const float ripple_m = 0.03f * std::sin(5 * (x_m + right)) * std::cos(4 * down);
      out.positions.push_back({x_m + right, down, 2.5f + ripple_m + noise_m});
    }
  for (std::uint32_t y = 0; y < rows; ++y)
    for (std::uint32_t x = 0; x < columns; ++x) {
      const std::uint32_t a = y * (columns + 1) + x, b = a + 1, c = a + columns + 1, d = c + 1;
      out.triangles.push_back({a, c, b});
      out.triangles.push_back({b, c, d});
    }
  return out;
}

kit::Part part_of(const Scene& scene, std::uint32_t sensor, float x_m, double triangles) {
  kit::Part part;
  part.mesh = wall(sensor, x_m, triangles);
  if (auto snapped = codec::snap_to_lattice(part.mesh, Lattice{}); snapped)
    part.mesh = *std::move(snapped);
  set_sensor(part.mesh, SensorId{sensor});
  SourceInfo source;
  source.sensor = SensorId{sensor}, source.depth_camera = camera_of(scene);
  source.T_world_depth.translation = {x_m, 0, 0};
  part.sources = {source};
  return part;
}

/// Sensors side by side along a wall, `step_m` apart.
std::vector<kit::Part> walls(const Scene& scene, float step_m, double triangles) {
  std::vector<kit::Part> out;
  for (std::uint32_t i = 0; i < kParts; ++i)
    out.push_back(part_of(scene, i, step_m * static_cast<float>(i), triangles));
  return out;
}

/// How many triangles lie where another of the walls is, too.
double shared_triangles(const std::vector<kit::Part>& parts, float step_m) {
  double out = 0;
  for (int i = 0; i < kParts; ++i)
    for (std::size_t t = 0; t < parts[i].mesh.triangles.size(); ++t) {
      const float x_m = parts[i].mesh.centroid(t).x;
      bool shared = false;
      for (int j = 0; j < kParts; ++j)
        shared |= j != i && std::abs(x_m - step_m * static_cast<float>(j)) < kWidthM / 2;
      out += shared;
    }
  return out;
}

Mesh merged(const Scene& scene, const std::vector<kit::Part>& parts) {
  return merge::merge_surfaces(
      parts, merge::surfaces_config({.owner = scene.merge.owner,
                                     .overlap = scene.merge.overlap,
                                     .voxel_m = scene.voxel_m,
                                     .calibration_error_m = scene.merge.calibration_error_m}));
}

std::vector<EncodedChunk> coded(const Scene& scene, const std::vector<kit::Part>& parts) {
  std::vector<Chunk> chunks;
  for (const kit::Part& part : parts)
    for (auto& [cube, mesh] : node::split_by_cube(part.mesh, scene.fusion.chunk_m))
      chunks.push_back({{{cube, part.sources[0].sensor}, 0, 1}, 0, std::move(mesh)});
  std::vector<EncodedChunk> out(chunks.size());
  parallel_for(chunks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (auto chunk = codec::encode_chunk(chunks[i], Lattice{}, CodingPlan{}.mesh_speed))
        out[i] = *std::move(chunk);
  });
  return out;
}

std::size_t decoded_triangles(const std::vector<EncodedChunk>& chunks) {
  std::vector<std::size_t> out(chunks.size());
  parallel_for(chunks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (const auto chunk = codec::decode_chunk(chunks[i], Lattice{}))
        out[i] = chunk->mesh.triangles.size();
  });
  return std::accumulate(out.begin(), out.end(), std::size_t{0});
}

/// The fastest of several runs, in ms.
template <typename Work>
double fastest_ms(Work&& work) {
  double best = std::numeric_limits<double>::max(), spent = 0;
  for (int i = 0; i < kRuns && spent < kEnoughMs; ++i) {
    double ms = 0;
    {
      const Stopwatch stopwatch(ms);
      work();
    }
    best = std::min(best, ms);
    spent += ms;
  }
  return best;
}

/// "VmHWM" or "VmRSS" of this process, in bytes; 0: not available.
double memory_bytes(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(key + ":")) return std::atof(line.c_str() + key.size() + 1) * 1024;
  return 0;
}

/// Peak increase of the process's memory during some work; 0: not available.
/// The most of several runs: what other threads give back meanwhile, and pages that the process
/// still had, make a run seem cheaper.
template <typename Work>
double peak_bytes(Work&& work) {
  double most = 0;
  for (int i = 0; i < kRuns; ++i) {
    ::malloc_trim(0);
    std::ofstream("/proc/self/clear_refs") << "5";  // Linux: the peak counts from here
    const double before = memory_bytes("VmRSS");
    work();
    most = std::max(most, memory_bytes("VmHWM") - before);
  }
  return most;
}

}  // namespace

MergeCosts measure_merge_costs(const Scene& scene, double triangles) {
  constexpr float kStepM = 1;
  const double each = std::clamp(triangles, 2'000.0, 20'000.0);
  const auto apart = walls(scene, 10, each), together = walls(scene, kStepM, each);
  const std::vector<EncodedChunk> chunks = coded(scene, together);
  double all = 0, bytes = 0;
  for (const EncodedChunk& chunk : chunks)
    all += chunk.triangles, bytes += static_cast<double>(chunk.payload.size());
  MergeCosts out;
  constexpr double kUsualBytes = 1000;
  const double peak = peak_bytes([&] {
    decoded_triangles(chunks);
    merged(scene, together);
  });
  out.memory_bytes = peak > 0 ? peak / all : kUsualBytes;
  out.decode_ns = 1e6 / all * fastest_ms([&] { decoded_triangles(chunks); });
  out.code_ns = 1e6 / all * fastest_ms([&] { coded(scene, together); });
  const double apart_ms = fastest_ms([&] { merged(scene, apart); });
  const double together_ms = fastest_ms([&] { merged(scene, together); });
  out.merge_ns = 1e6 / all * apart_ms;
  out.overlap_ns = 1e6 / shared_triangles(together, kStepM) * std::max(together_ms - apart_ms, 0.0);
  out.coded_bytes = bytes / all;
  return out;
}

}  // namespace mr::planner
