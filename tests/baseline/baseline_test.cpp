#include "mr/baseline/baseline.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "baseline/baseline_support.h"
#include "mr/baseline/cameras.h"
#include "mr/baseline/monolithic.h"
#include "mr/baseline/wire.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"
#include "mr/sensor/registration.h"

namespace mr {
namespace {

using baseline::Bytes;
using test::Rig;
using test::value;

const char* const kPipelines[] = {"holoportation", "holoportation++", "points", "rgbd"};

const Mesh& mesh_of(const baseline::Geometry& geometry) { return geometry.chunks.front()->mesh; }

/// Every vertex of `a` is a vertex of `b`.
bool vertices_within(const Mesh& a, const Mesh& b) {
  std::vector<Vec3f> sorted = b.positions;
  std::sort(sorted.begin(), sorted.end());
  return std::all_of(a.positions.begin(), a.positions.end(),
                     [&](Vec3f p) { return std::binary_search(sorted.begin(), sorted.end(), p); });
}

/// Root mean square distance of a's centroids from b; what lies farther than `reach_m` does not
/// count.
double rms_distance_m(const Mesh& a, const Mesh& b, float reach_m) {
  const Mesh* meshes[] = {&b};
  const kit::RayScene rays(meshes);
  double sum = 0;
  std::size_t hits = 0;
  for (std::size_t t = 0; t < a.triangles.size(); ++t)
    if (const auto near = rays.nearest(a.centroid(t), reach_m))
      sum += near->distance_m * near->distance_m, ++hits;
  EXPECT_GT(hits, a.triangles.size() * 9 / 10);
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(hits, 1)));
}

double psnr_db(const ImageRgb& a, const ImageRgb& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i)
    sum += (a.data[i] - b.data[i]) * (a.data[i] - b.data[i]);
  return 10 * std::log10(255.0 * 255.0 * static_cast<double>(a.data.size()) / std::max(sum, 1.0));
}

TEST(Monolithic, OneGridOfAllSensorsCoversWhatEachSees) {
  const Rig rig("holoportation");
  const Mesh all = baseline::fuse_all(rig.scene, rig.captures[0], 0.03);
  double largest = 0;
  for (const Frame& frame : rig.captures[0]) {
    const Mesh one = baseline::fuse_all(rig.scene, std::span(&frame, 1), 0.03);
    largest = std::max(largest, surface_area_m2(one));
    EXPECT_LT(rms_distance_m(one, all, 0.1), 0.015);
  }
  EXPECT_GT(surface_area_m2(all), 1.3 * largest);
  EXPECT_EQ(kit::count_nonmanifold_edges(all), 0u);
  EXPECT_TRUE(baseline::fuse_all(rig.scene, {}, 0.03).empty());
}

TEST(Monolithic, ViewsAreOfTheFramesWithColour) {
  Rig rig("holoportation");
  rig.captures[0][1].color = {};
  std::swap(rig.captures[0][0], rig.captures[0][2]);
  const auto views = baseline::color_views(rig.scene, rig.captures[0]);
  ASSERT_EQ(views.size(), 2u);
  EXPECT_EQ(views[0].id, ViewId{0});
  EXPECT_EQ(views[1].id, ViewId{2});
  for (const View& view : views) {
    const SensorId id = sensor_of(view.id);
    const SensorConfig& config = rig.scene.sensor(id);
    const sensor::Registration registration(config, id);
    View wanted = *registration.color_view(config.T_world_depth[0]);
    wanted.stream = stream_of(id);
    EXPECT_EQ(view, wanted);
  }
}

TEST(Baseline, HoloportationIsLossless) {
  Rig rig("holoportation");
  const Mesh fused = baseline::fuse_all(rig.scene, rig.captures[0], rig.scene.voxel_m);
  const auto geometry =
      value(rig.system->decode_geometry(value(rig.system->encode_geometry(rig.captures[0]))));
  const Mesh& mesh = mesh_of(geometry);
  // Cutting along occlusion edges adds vertices and moves none.
  EXPECT_TRUE(vertices_within(fused, mesh));
  EXPECT_NEAR(surface_area_m2(mesh), surface_area_m2(fused), 1e-3);
  EXPECT_EQ(geometry.views, baseline::color_views(rig.scene, rig.captures[0]));
  std::size_t textured = 0;
  for (const ViewRun& run : mesh.views) textured += run.id == kNoView ? 0 : run.count;
  EXPECT_GT(textured, mesh.triangles.size() * 8 / 10);

  const auto texture =
      value(rig.system->decode_texture(value(rig.system->encode_texture(rig.captures[0]))));
  ASSERT_EQ(texture.views.size(), 3u);
  for (const View& view : texture.views) {
    const ImageRgb& picture = *texture.pictures.at(view.stream);
    EXPECT_EQ(picture, baseline::tile_picture(rig.captures[0][number_of(view.id)].color, view));
    EXPECT_EQ(picture.width, view.image_rect.width);
  }
}

TEST(Baseline, TextureScaleAveragesAreas) {
  ImageRgb color(8, 4);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 8; ++x)
      std::fill_n(color.at(x, y), 3, static_cast<std::uint8_t>(10 * x + 100 * (y / 2)));
  View view;
  view.image_rect = {2, 0, 6, 4};
  view.atlas_rect = {0, 0, 3, 2};
  const ImageRgb tile = baseline::tile_picture(color, view);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 3; ++x) EXPECT_EQ(*tile.at(x, y), 25 + 20 * x + 100 * y);
  view.atlas_rect = {0, 0, 4, 4};  // 1.5 pixels to one
  EXPECT_EQ(*baseline::tile_picture(color, view).at(0, 0), std::lround((20 * 1 + 30 * .5) / 1.5));
}

TEST(Baseline, ScaledTilesAreMadeFromBytesAndSceneAlone) {
  for (const char* const pipeline : {"holoportation", "holoportation++", "rgbd"}) {
    SCOPED_TRACE(pipeline);
    Scene scene = test::small_scene(pipeline);
    scene.coding.texture_scale = 0.35;  // odd sizes
    Rig rig(scene, 1);
    const Bytes bytes = value(rig.system->encode_texture(rig.captures[0]));
    const auto texture = value(rig.fresh()->decode_texture(bytes));
    ASSERT_EQ(texture.views.size(), 3u);
    for (const View& view : texture.views) {
      const ImageRgb wanted =
          baseline::tile_picture(rig.captures[0][number_of(view.id)].color, view);
      EXPECT_EQ(wanted.width, std::lround(0.35 * view.image_rect.width));
      ImageRgb got(wanted.width, wanted.height);
      const ImageRgb& picture = *texture.pictures.at(view.stream);
      ASSERT_GE(picture.width, got.width);
      for (int y = 0; y < got.height; ++y) std::copy_n(picture.row(y), 3 * got.width, got.row(y));
      EXPECT_GT(psnr_db(got, wanted), 28);
    }
  }
}

TEST(Baseline, HoloportationPlusStaysNearTheGridOnTheLattice) {
  Rig rig("holoportation++");
  const Mesh fused = baseline::fuse_all(rig.scene, rig.captures[0], rig.scene.voxel_m);
  const Bytes bytes = value(rig.system->encode_geometry(rig.captures[0]));
  const auto geometry = value(rig.system->decode_geometry(bytes));
  const Mesh& mesh = mesh_of(geometry);
  EXPECT_LT(rms_distance_m(mesh, fused, 0.1), 0.01);
  EXPECT_NEAR(surface_area_m2(mesh), surface_area_m2(fused), 0.05 * surface_area_m2(fused));
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
  // Far smaller than what nothing is done to.
  Rig raw("holoportation");
  EXPECT_LT(4 * bytes.size(), value(raw.system->encode_geometry(raw.captures[0])).size());
}

TEST(Baseline, PiecesDecimatedApartLeaveNoNewCracks) {
  Scene whole_room = test::small_scene("holoportation++");
  whole_room.fusion.chunk_m = 100;
  whole_room.simplify.ratio = 0.1;
  Scene pieces = whole_room;
  pieces.fusion.chunk_m = 0.64;
  double border_m[2];
  int i = 0;
  for (const Scene& scene : {whole_room, pieces}) {
    Rig rig(scene, 1);
    const auto geometry =
        value(rig.system->decode_geometry(value(rig.system->encode_geometry(rig.captures[0]))));
    const Mesh mesh = kit::weld(mesh_of(geometry));
    const auto edges = kit::edge_table(mesh);
    border_m[i] = 0;
    for (std::uint32_t h = 0; h < edges.uses.size(); ++h)
      if (edges.uses[h] == 1)
        border_m[i] +=
            length(mesh.positions[kit::edge_to(mesh, h)] - mesh.positions[kit::edge_from(mesh, h)]);
    ++i;
  }
  EXPECT_LT(border_m[1], 1.03 * border_m[0]);
}

TEST(Baseline, RgbdBuildsTheSameSurfaceAtTheReceiver) {
  Rig rig("rgbd");
  const Mesh fused = baseline::fuse_all(rig.scene, rig.captures[0], rig.scene.voxel_m);
  const Bytes bytes = value(rig.system->encode_geometry(rig.captures[0]));
  const auto geometry = value(rig.fresh()->decode_geometry(bytes));
  EXPECT_LT(rms_distance_m(fused, mesh_of(geometry), 0.1), 0.01);
  EXPECT_NEAR(surface_area_m2(mesh_of(geometry)), surface_area_m2(fused),
              0.1 * surface_area_m2(fused));
}

TEST(Baseline, PointsLieOnTheSurfaceInItsColours) {
  Rig rig("points");
  const Mesh fused = baseline::fuse_all(rig.scene, rig.captures[0], rig.scene.voxel_m);
  const auto geometry =
      value(rig.system->decode_geometry(value(rig.system->encode_geometry(rig.captures[0]))));
  const Chunk& chunk = *geometry.chunks.front();
  EXPECT_TRUE(chunk.mesh.triangles.empty());
  ASSERT_EQ(chunk.colors.size(), chunk.mesh.positions.size());
  EXPECT_GT(chunk.point_m, rig.scene.voxel_m);
  // About one point per voxel that the surface passes through.
  const double voxels = surface_area_m2(fused) / (rig.scene.voxel_m * rig.scene.voxel_m);
  EXPECT_GT(static_cast<double>(chunk.mesh.positions.size()), 0.5 * voxels);
  EXPECT_LT(static_cast<double>(chunk.mesh.positions.size()), 2.5 * voxels);
  for (const Vec3f& p : chunk.mesh.positions) ASSERT_EQ(p, rig.scene.lattice.snap(p));
  EXPECT_TRUE(value(rig.system->encode_texture(rig.captures[0])).empty());
  const auto texture = value(rig.system->decode_texture({}));
  EXPECT_TRUE(texture.pictures.empty());
}

TEST(Baseline, VideoGoesOnFromCallToCall) {
  for (const char* const pipeline : {"holoportation++", "rgbd"}) {
    SCOPED_TRACE(pipeline);
    Rig rig(pipeline, 3, 2);
    const auto receiver = rig.fresh();
    std::vector<std::size_t> sizes;
    for (const auto& capture : rig.captures) {
      const Bytes geometry = value(rig.system->encode_geometry(capture));
      const Bytes texture = value(rig.system->encode_texture(capture));
      sizes.push_back(texture.size());
      EXPECT_FALSE(mesh_of(value(receiver->decode_geometry(geometry))).empty());
      EXPECT_EQ(value(receiver->decode_texture(texture)).pictures.size(), 2u);
    }
    EXPECT_LT(sizes[1], sizes[0]);  // no second key frame
    EXPECT_LT(sizes[2], sizes[0]);
    // A late joiner has no key frame to start from.
    EXPECT_FALSE(rig.fresh()->decode_texture(value(rig.system->encode_texture(rig.captures[2]))));
  }
}

TEST(Baseline, EmptyCapturesAreAnError) {
  for (const char* const pipeline : kPipelines) {
    SCOPED_TRACE(pipeline);
    Rig rig(pipeline, 1, 1);
    const auto nothing = rig.system->encode_geometry({});
    ASSERT_FALSE(nothing);
    EXPECT_EQ(nothing.error().cause, Error::Cause::empty);
    Frame blind = rig.captures[0][0];
    std::fill(blind.depth.data.begin(), blind.depth.data.end(), 0.0f);
    const auto coded = rig.system->encode_geometry(std::span(&blind, 1));
    if (coded) {
      EXPECT_FALSE(rig.system->decode_geometry(*coded));
    } else {
      EXPECT_EQ(coded.error().cause, Error::Cause::empty);
    }
  }
}

TEST(Baseline, OnlyBaselinesWithColourAreMade) {
  Scene scene = *node::prepare_scene(test::small_scene("meshreduce"));
  const auto other = baseline::make_baseline(scene);
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().cause, Error::Cause::unsupported);
  scene.pipeline = "points";
  for (SensorConfig& sensor : scene.sensors) sensor.color_camera.reset();
  const auto grey = baseline::make_baseline(scene);
  ASSERT_FALSE(grey);
  EXPECT_EQ(grey.error().cause, Error::Cause::empty);
}

TEST(Baseline, SameBytesOnAnyNumberOfThreads) {
  for (const char* const pipeline : kPipelines) {
    SCOPED_TRACE(pipeline);
    Rig rig(pipeline, 2, 2);
    std::vector<Bytes> bytes[2];
    int i = 0;
    for (const int threads : {1, 8}) {
      Arena arena(threads);
      arena.run([&] {
        const auto system = rig.fresh();
        for (const auto& capture : rig.captures) {
          bytes[i].push_back(value(system->encode_geometry(capture)));
          bytes[i].push_back(value(system->encode_texture(capture)));
        }
      });
      ++i;
    }
    EXPECT_EQ(bytes[0], bytes[1]);
  }
}

/// The same body, damaged or not, with a check sum that fits.
Bytes resealed(const Bytes& message, const Bytes& body) {
  const auto kind = static_cast<baseline::Message>(std::to_integer<int>(message[3]));
  return baseline::seal(kind, body);
}

/// Decoding neither crashes nor hangs; what it gives fits together.
void try_decoding(baseline::Baseline& system, const Bytes& bytes, bool geometry) {
  if (!geometry) return static_cast<void>(system.decode_texture(bytes).ok());
  const auto decoded = system.decode_geometry(bytes);
  if (!decoded) return;
  for (const auto& chunk : decoded->chunks)
    for (const Triangle& t : chunk->mesh.triangles)
      for (const std::uint32_t v : t) ASSERT_LT(v, chunk->mesh.positions.size());
}

TEST(Baseline, DamagedBytesAreRefused) {
  for (const char* const pipeline : kPipelines) {
    SCOPED_TRACE(pipeline);
    Rig rig(pipeline, 1, 1);
    for (const bool geometry : {true, false}) {
      const Bytes good = geometry ? value(rig.system->encode_geometry(rig.captures[0]))
                                  : value(rig.system->encode_texture(rig.captures[0]));
      if (good.empty()) continue;  // points have no pictures
      const auto accepted = [&](const Bytes& bytes) {
        const auto system = rig.fresh();
        return geometry ? system->decode_geometry(bytes).ok() : system->decode_texture(bytes).ok();
      };
      EXPECT_TRUE(accepted(good));
      EXPECT_FALSE(accepted({}));
      std::mt19937 random(1);
      for (int i = 0; i < 40; ++i) {
        Bytes cut = good, flipped = good;
        cut.resize(random() % good.size());
        EXPECT_FALSE(accepted(cut));
        flipped[random() % good.size()] ^= static_cast<std::byte>(1 << random() % 8);
        EXPECT_FALSE(accepted(flipped));
      }
    }
  }
}

TEST(Baseline, DamageBehindAFittingCheckSumDoesNoHarm) {
  constexpr std::size_t kSealBytes = 12;
  for (const char* const pipeline : kPipelines) {
    SCOPED_TRACE(pipeline);
    Rig rig(pipeline, 1, 1);
    for (const bool geometry : {true, false}) {
      const Bytes good = geometry ? value(rig.system->encode_geometry(rig.captures[0]))
                                  : value(rig.system->encode_texture(rig.captures[0]));
      if (good.empty()) continue;
      const Bytes body(good.begin() + kSealBytes, good.end());
      ASSERT_EQ(resealed(good, body), good);
      std::mt19937 random(2);
      for (int i = 0; i < 30; ++i) {
        Bytes damaged = body;
        // Half of the damage is near the front, where sizes are stored.
        const std::size_t reach = i % 2 ? std::min<std::size_t>(120, body.size()) : body.size();
        for (int n = 0; n < 1 + i % 3; ++n)
          damaged[random() % reach] = static_cast<std::byte>(random() % 256);
        if (i % 5 == 0) damaged.resize(random() % body.size());
        try_decoding(*rig.fresh(), resealed(good, damaged), geometry);
      }
    }
  }
}

TEST(Baseline, PosesThatTheSceneLacksGoWithTheFrame) {
  Rig rig("holoportation", 1, 2);
  std::vector<Frame> moved = rig.captures[0];
  moved[1].T_world_depth.translation.x += 0.25;
  const auto geometry =
      value(rig.system->decode_geometry(value(rig.system->encode_geometry(moved))));
  ASSERT_EQ(geometry.sources.size(), 2u);
  EXPECT_EQ(geometry.sources[0].T_world_depth, moved[0].T_world_depth);
  EXPECT_NEAR(geometry.sources[1].T_world_depth.translation.x, moved[1].T_world_depth.translation.x,
              1e-9);
  EXPECT_EQ(geometry.sources[1].captured_at, moved[1].captured_at());
}

}  // namespace
}  // namespace mr
