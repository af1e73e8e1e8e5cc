#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mr/codec/packet_codec.h"
#include "mr/core/parallel.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"
#include "mr/node/root_atlas.h"
#include "mr/runtime/lockstep_scene.h"
#include "mr/synth/truth.h"
#include "support/rig_scene.h"

/// Running scenes capture by capture, and comparing the surfaces that come out.
namespace mr::test {

inline Scene with_layers(Scene scene) {
  scene.still.layers = true;
  return scene;
}

/// A scene in lockstep, one capture at a time, as a client sees it.
class Captures {
 public:
  explicit Captures(const Scene& scene, int threads = 2) : arena_(threads) {
    arena_.run([&] {
      auto pipeline = runtime::LockstepScene::open(scene);
      EXPECT_TRUE(pipeline) << pipeline.error().message;
      if (pipeline) pipeline_ = *std::move(pipeline);
    });
  }

  /// Captures until `number` is the newest; they count from 0.
  void run_to(int number) {
    while (number_ < number) next();
  }
  /// Captures `number` and nothing in between.
  void skip_to(int number) {
    pipeline_->skip(static_cast<std::uint64_t>(number - number_ - 1));
    number_ = number - 1;
    next();
  }
  void next() {
    mesh_bytes = texture_bytes = 0;
    runtime::RunListener listener;
    listener.dropped = [&](const std::string& line) { told.push_back("dropped: " + line); };
    listener.warned = [&](const std::string& line) { told.push_back(line); };
    listener.sent = [&](int, std::uint64_t mesh, std::uint64_t texture) {
      mesh_bytes = mesh, texture_bytes = texture;
    };
    arena_.run([&] {
      const auto report = pipeline_->run(1, listener);
      ASSERT_TRUE(report) << report.error().message;
    });
    ++number_;
  }

  int number() const { return number_; }
  const DecodedScene& scene() const { return *pipeline_->decoded(); }
  std::vector<std::byte> bytes() const { return pipeline_->last_packet(); }
  Packet packet() const { return *codec::decode_packet(bytes()); }

  Mesh surface() const { return surface_of({}); }
  Mesh surface_of(std::optional<Layer> layer) const {
    Mesh out;
    for (const auto& chunk : scene().chunks)
      if (!layer || chunk->key.id.layer == *layer) append(out, chunk->mesh);
    return out;
  }
  std::vector<ChunkKey> keys(Layer layer) const {
    std::vector<ChunkKey> out;
    for (const auto& chunk : scene().chunks)
      if (chunk->key.id.layer == layer) out.push_back(chunk->key);
    return out;
  }

  std::uint64_t mesh_bytes = 0, texture_bytes = 0;  ///< of the newest capture
  std::vector<std::string> told;                    ///< since the beginning

 private:
  Arena arena_;
  std::unique_ptr<runtime::LockstepScene> pipeline_;
  int number_ = -1;
};

/// A point of a surface.
struct SurfacePoint {
  Vec3f at, normal;
  std::uint32_t triangle = 0;
};

/// Points spread over a surface, each for 4 cm². (Of 80 cm² each, 0.2 % of a room is eight points,
/// and one more or less is luck.)
inline std::vector<SurfacePoint> surface_points(const Mesh& mesh) {
  constexpr double kEach_m2 = 0.0004, kGolden = 0.7548776662466927, kOther = 0.5698402909980532;
  std::vector<SurfacePoint> out;
  double due = 0.5;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f normal = mesh.area_normal(t);
    for (due += length(normal) / 2 / kEach_m2; due >= 1; --due) {
      const auto n = static_cast<double>(out.size());
      double u = std::fmod(n * kGolden, 1.0), v = std::fmod(n * kOther, 1.0);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      const Vec3f a = mesh.corner(t, 0);
      out.push_back({a + (mesh.corner(t, 1) - a) * static_cast<float>(u) +
                         (mesh.corner(t, 2) - a) * static_cast<float>(v),
                     normalized(normal), t});
    }
  }
  return out;
}

/// The share of a surface that has nothing of another within reach.
inline double share_without(const Mesh& surface, const Mesh& other, double reach_m) {
  const Mesh* meshes[] = {&other};
  const kit::RayScene rays(meshes);
  const std::vector<SurfacePoint> all = surface_points(surface);
  double without = 0;
  for (const SurfacePoint& point : all)
    without += !rays.nearest(point.at, static_cast<float>(reach_m));
  return all.empty() ? 0 : without / static_cast<double>(all.size());
}

/// The share of a surface that has a second sheet within reach along its normal, either way, which
/// faces alike and does not touch it.
inline double doubled_share(const Mesh& surface, double reach_m) {
  const Mesh* meshes[] = {&surface};
  const kit::RayScene rays(meshes);
  const std::vector<std::uint32_t> place = kit::same_place(surface.positions);
  const auto touch = [&](std::uint32_t s, std::uint32_t t) {
    for (const std::uint32_t a : surface.triangles[s])
      for (const std::uint32_t b : surface.triangles[t])
        if (place[a] == place[b]) return true;
    return false;
  };
  const std::vector<SurfacePoint> all = surface_points(surface);
  double doubled = 0;
  std::vector<kit::RayHit> hits;
  for (const SurfacePoint& point : all) {
    const auto reach = static_cast<float>(reach_m);
    rays.all_hits(point.at, point.normal, -reach, reach, hits);
    doubled += std::ranges::any_of(hits, [&](const kit::RayHit& hit) {
      return dot(normalized(surface.area_normal(hit.triangle)), point.normal) > 0.5f &&
             !touch(point.triangle, hit.triangle);
    });
  }
  return all.empty() ? 0 : doubled / static_cast<double>(all.size());
}

/// What is asked of a scene with layers at one capture, beside the same scene without.
struct Difference {
  double missing = 0;                     ///< of what is shown without layers
  double ghost = 0, usual_ghost = 0;      ///< shares that truth has not; without layers
  double doubled = 0, usual_doubled = 0;  ///< shares
};

/// The same scene without layers, made anew for single captures, and the truth.
class Reference {
 public:
  explicit Reference(Scene scene) : scene_(std::move(scene)) { scene_.still.layers = false; }

  Difference compare(const Captures& here) {
    const double reach_m = 2.5 * scene_.voxel_m;
    if (!usual_) usual_.emplace(scene_), truth_.emplace(*scene_.rig, scene_.fps);
    usual_->skip_to(here.number());
    const Mesh mine = here.surface(), usual = usual_->surface(),
               truth = truth_->surface(static_cast<std::uint64_t>(here.number())).mesh;
    return {share_without(usual, mine, reach_m), share_without(mine, truth, reach_m),
            share_without(usual, truth, reach_m), doubled_share(mine, reach_m),
            doubled_share(usual, reach_m)};
  }

 private:
  Scene scene_;
  std::optional<Captures> usual_;
  std::optional<synth::Truth> truth_;
};

inline std::ostream& operator<<(std::ostream& out, const Difference& d) {
  return out << "missing " << d.missing << ", ghost " << d.ghost << " (" << d.usual_ghost
             << "), doubled " << d.doubled << " (" << d.usual_doubled << ")";
}

}  // namespace mr::test
