#include "mr/eval/quality.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "eval/small_scene.h"
#include "mr/eval/geometry_buffer.h"
#include "mr/eval/geometry_error.h"
#include "mr/eval/seen_masks.h"
#include "mr/eval/system.h"
#include "mr/kit/topology.h"

namespace mr::eval {
namespace {

/// Measurements shared by the tests of this file, made once.
struct Measured {
  SmallScene small;
  Trial trial;
  MultiViewSsim metric;
  DecodedStream stream;
};

const Measured& measured() {
  static const Measured* const made = [] {
    auto* m = new Measured;
    auto trial = Trial::prepare(m->small.scene, m->small.config());
    if (!trial) ADD_FAILURE() << trial.error().message;
    m->trial = *std::move(trial);
    auto metric = m->trial.metric({0}, 4, 1, m->small.config());
    if (!metric) ADD_FAILURE() << metric.error().message;
    m->metric = *std::move(metric);
    auto stream = run_pipeline(m->small.scene, m->trial.moments(), m->small.config());
    if (!stream) ADD_FAILURE() << stream.error().message;
    m->stream = *std::move(stream);
    return m;
  }();
  return *made;
}

QualityReport quality_of(const DecodedStream& stream) {
  const Measured& m = measured();
  const auto report = measure_quality(m.trial, m.metric, m.small.scene, stream, m.small.config());
  if (report) return *report;
  ADD_FAILURE() << report.error().message;
  return {};
}

Mesh whole(const DecodedScene& scene) {
  Mesh mesh;
  for (const auto& chunk : scene.chunks) append(mesh, chunk->mesh);
  return kit::weld(mesh);
}

GeometryError against_itself(const DecodedScene& scene) {
  const auto error = geometry_error(whole(scene), whole(measured().stream.shown[0]), {},
                                    {.voxel_m = 0.03, .samples = 40'000});
  if (error) return *error;
  ADD_FAILURE() << error.error().message;
  return {};
}

/// The same stream with every chunk's mesh changed.
template <typename Change>
DecodedStream with_meshes(const Change& change) {
  DecodedStream out = measured().stream;
  for (auto& chunk : out.shown[0].chunks) {
    Chunk changed = *chunk;
    change(changed.mesh);
    chunk = std::make_shared<const Chunk>(changed);
  }
  return out;
}

/// Every picture moved to the right.
DecodedStream with_shifted_texture(int pixels) {
  DecodedStream out = measured().stream;
  for (auto& [stream, picture] : out.shown[0].textures) {
    ImageRgb moved = *picture;
    for (int y = 0; y < moved.height; ++y)
      std::copy_n(picture->row(y), 3 * (moved.width - pixels), moved.row(y) + 3 * pixels);
    picture = std::make_shared<const ImageRgb>(moved);
  }
  return out;
}

TEST(Quality, OfASmallRoomIsPlausible) {
  const QualityReport report = quality_of(measured().stream);
  EXPECT_EQ(report.reference, ReferenceKind::truth);
  EXPECT_EQ(report.views, 4);
  EXPECT_EQ(report.frames, 1);
  EXPECT_GT(report.score.masked.mean, 0.4);
  EXPECT_LT(report.score.masked.mean, 0.99);
  EXPECT_LE(report.score.masked.min, report.score.masked.p5);
  EXPECT_LE(report.score.masked.p5, report.score.masked.mean);
  EXPECT_GT(report.mesh_mbps, 0.1);
  EXPECT_GT(report.texture_mbps, 0.1);
}

TEST(Quality, TheReferenceItselfIsPerfect) {
  const Measured& m = measured();
  const auto pictures = m.trial.pictures({0}, 4, 0, m.small.config());
  ASSERT_TRUE(pictures.ok()) << pictures.error().message;
  for (std::size_t v = 0; v < 4; ++v) {
    const RenderedView& picture = (*pictures)[0][v];
    const auto score = m.metric.compare(0, v, luma_of(picture.color), picture.covered);
    ASSERT_TRUE(score.ok());
    EXPECT_NEAR(score->ssim_masked, 1, 1e-6);
  }
}

TEST(SeededError, AShiftedTextureLowersSsimAndLeavesTheGeometry) {
  const DecodedStream shifted = with_shifted_texture(8);
  EXPECT_LT(quality_of(shifted).score.masked.mean,
            quality_of(measured().stream).score.masked.mean - 0.02);
  EXPECT_LT(against_itself(shifted.shown[0]).to_reference.max_mm, 0.01);
}

TEST(SeededError, AHoleIsMissing) {
  const Mesh before = whole(measured().stream.shown[0]);
  const Vec3f middle = before.centroid(before.triangles.size() / 2);
  const DecodedStream holed = with_meshes([&](Mesh& mesh) {
    std::vector<std::uint8_t> keep(mesh.triangles.size());
    for (std::size_t t = 0; t < keep.size(); ++t)
      keep[t] = length(mesh.centroid(t) - middle) > 0.5f ? 1 : 0;
    mesh = select_triangles(mesh, keep);
  });
  const double lost = 1 - surface_area_m2(whole(holed.shown[0])) / surface_area_m2(before);
  ASSERT_GT(lost, 0.005);
  const GeometryError error = against_itself(holed.shown[0]);
  EXPECT_GT(error.missing_ratio, 0.6 * lost);  // but for a voxel around the hole's rim
  EXPECT_LT(error.missing_ratio, lost);
  EXPECT_EQ(against_itself(measured().stream.shown[0]).missing_ratio, 0);
  EXPECT_LT(error.to_reference.max_mm, 0.01);
  EXPECT_LT(quality_of(holed).score.masked.mean, quality_of(measured().stream).score.masked.mean);
}

TEST(SeededError, ADoubledWallIsADuplicate) {
  const DecodedStream doubled = with_meshes([](Mesh& mesh) {
    Mesh behind = mesh;
    const std::vector<Vec3f> normals = kit::vertex_normals(mesh);
    for (std::size_t v = 0; v < normals.size(); ++v)
      behind.positions[v] = behind.positions[v] - normals[v] * 0.045f;
    append(mesh, behind);
  });
  const double before = against_itself(measured().stream.shown[0]).duplicate_ratio;
  const double after = against_itself(doubled.shown[0]).duplicate_ratio;
  EXPECT_LT(before, 0.2);
  EXPECT_GT(after, before + 0.5);
  EXPECT_LT(against_itself(doubled.shown[0]).missing_ratio, 0.001);
}

TEST(Quality, NoiseLeavesNoChunkToKeep) {
  // Why layers are needed, and sweeps without may code every capture for itself: sensors never
  // measure the same twice.
  SmallScene small(", people: 1", "still: {layers: false}\n");
  const auto trial = Trial::prepare(small.scene, small.config());
  ASSERT_TRUE(trial.ok()) << trial.error().message;
  const auto kept = run_pipeline(small.scene, trial->moments(), small.config());
  small.scene.reuse_chunks = false;
  const auto afresh = run_pipeline(small.scene, trial->moments(), small.config());
  ASSERT_TRUE(kept.ok() && afresh.ok());
  EXPECT_GT(kept->mesh_mbps, 0.95 * afresh->mesh_mbps);
}

TEST(Quality, ALateStreamIsJudgedByWhatIsThereBothSidesOfItsMeanAge) {
  const SmallScene small(", people: 2");
  const auto trial = Trial::prepare(small.scene, small.config());
  ASSERT_TRUE(trial.ok()) << trial.error().message;
  const auto pictures = trial->pictures({0}, 1, 0, small.config());
  ASSERT_TRUE(pictures.ok()) << pictures.error().message;
  const RenderedView& now = pictures->front().front();
  std::vector<double> ssim;
  for (const int divider : {1, 2, 3}) {  // 0, 0.5 and 1 captures late
    const auto metric = trial->metric({0}, 1, divider, small.config());
    ASSERT_TRUE(metric.ok()) << metric.error().message;
    ssim.push_back(metric->compare(0, 0, luma_of(now.color), now.covered)->ssim_masked);
  }
  EXPECT_NEAR(ssim[0], 1, 1e-6);
  EXPECT_LT(ssim[2], 0.9999);
  EXPECT_NEAR(ssim[1], (ssim[0] + ssim[2]) / 2, 1e-6);
}

/// Shares of the pixels of a view that we and the renderer cover alike, and shade within two
/// levels.
struct Alike {
  double covered = 0, shaded = 0;
};
Alike compare_with_renderer(render::Renderer& renderer, const DecodedScene& scene,
                            const LumaTexture& texture, const render::Viewpoint& view) {
  const auto drawn = draw_scene(renderer, scene, view);
  if (!drawn) return ADD_FAILURE() << drawn.error().message, Alike{};
  const GeometryBuffer buffer = draw_geometry({scene.chunks, scene.views, {}}, view);
  const ImageLuma ours = shade(buffer, texture), theirs = luma_of(drawn->color);
  Alike out;
  for (std::size_t i = 0; i < ours.data.size(); ++i) {
    out.covered += buffer.covered.data[i] == drawn->covered.data[i];
    out.shaded += std::abs(ours.data[i] - theirs.data[i]) < 2;
  }
  const auto all = static_cast<double>(ours.data.size());
  return {out.covered / all, out.shaded / all};
}

TEST(GeometryBuffer, ShadesAsTheRendererDraws) {
  const Measured& m = measured();
  const DecodedScene& scene = m.stream.shown[0];
  auto renderer = render::Renderer::create();
  ASSERT_TRUE(renderer.ok()) << renderer.error().message;
  const LumaTexture texture = luma_texture({scene.views, scene.textures});
  for (const render::Viewpoint& view : m.trial.plan().views) {
    const Alike alike = compare_with_renderer(*renderer, scene, texture, view);
    EXPECT_GT(alike.covered, 0.999) << view.name;
    EXPECT_GT(alike.shaded, 0.998) << view.name;
  }
}

TEST(System, TakenApartIsAsGoodAsTheWhole) {
  const Measured& m = measured();
  const GeometrySetting setting = geometry_setting(m.small.scene);
  auto system =
      make_system(m.small.scene, {m.trial.moments(), m.small.config().rig_cache, {}, {setting}});
  ASSERT_TRUE(system.ok()) << system.error().message;
  const auto joined =
      run_pipeline_halves(**system, m.small.scene, m.trial.moments(), m.small.config());
  ASSERT_TRUE(joined.ok()) << joined.error().message;
  const QualityReport apart = quality_of(*joined), together = quality_of(m.stream);
  EXPECT_NEAR(apart.score.masked.mean, together.score.masked.mean, 0.002);
  EXPECT_NEAR(apart.mesh_mbps / together.mesh_mbps, 1, 0.05);
  EXPECT_NEAR(apart.texture_mbps / together.texture_mbps, 1, 0.05);
}

/// A small room with layers and a person, warmed up; measured as a whole and by halves.
struct Remembered {
  SmallScene small{", people: 1, frames: 300", "still: {layers: true}\n"};
  Trial trial;
  MultiViewSsim metric;
  DecodedStream whole, apart;
};

const Remembered& remembered() {
  static const std::unique_ptr<const Remembered> made = [] {
    auto m = std::make_unique<Remembered>();
    const QualityConfig config = m->small.config();
    auto trial = Trial::prepare(m->small.scene, config);
    if (!trial) return ADD_FAILURE() << trial.error().message, std::move(m);
    m->trial = *std::move(trial);
    auto metric = m->trial.metric({0}, 4, 1, config, true);
    if (!metric) return ADD_FAILURE() << metric.error().message, std::move(m);
    m->metric = *std::move(metric);
    auto whole = run_pipeline(m->small.scene, m->trial.moments(), config);
    if (!whole) return ADD_FAILURE() << whole.error().message, std::move(m);
    m->whole = *std::move(whole);
    const GeometrySetting setting = geometry_setting(m->small.scene);
    auto system =
        make_system(m->small.scene, {m->trial.moments(), config.rig_cache, {}, {setting}});
    if (!system) return ADD_FAILURE() << system.error().message, std::move(m);
    auto apart = run_pipeline_halves(**system, m->small.scene, m->trial.moments(), config);
    if (!apart) return ADD_FAILURE() << apart.error().message, std::move(m);
    m->apart = *std::move(apart);
    return m;
  }();
  return *made;
}

TEST(SteadyState, ChunksOfTheStillSurfaceCountAsKept) {
  const Remembered& m = remembered();
  Scene anew = m.small.scene;
  anew.still.layers = false;
  const auto everything = run_pipeline(anew, m.trial.moments(), m.small.config());
  ASSERT_TRUE(everything.ok()) << everything.error().message;
  EXPECT_LT(m.whole.mesh_mbps, 0.5 * everything->mesh_mbps);
  EXPECT_GT(m.whole.refresh_mbps, 0.05);
  EXPECT_EQ(everything->refresh_mbps, 0);
  bool still = false, moving = false;
  for (const auto& chunk : m.whole.shown.at(0).chunks)
    (chunk->key.id.layer == Layer::still ? still : moving) = true;
  EXPECT_TRUE(still && moving);
}

TEST(SteadyState, TakenApartIsAsGoodAsTheWhole) {
  const Remembered& m = remembered();
  const auto score = [&](const DecodedStream& stream) {
    const auto report = measure_quality(m.trial, m.metric, m.small.scene, stream, m.small.config());
    if (!report) ADD_FAILURE() << report.error().message;
    return report ? report->score : MultiViewScore{};
  };
  const MultiViewScore apart = score(m.apart), whole = score(m.whole);
  EXPECT_NEAR(apart.masked.mean, whole.masked.mean, 0.005);
  EXPECT_NEAR(m.apart.mesh_mbps / m.whole.mesh_mbps, 1, 0.05);
  EXPECT_NEAR(m.apart.texture_mbps / m.whole.texture_mbps, 1, 0.3);
  EXPECT_NEAR(m.apart.refresh_mbps / m.whole.refresh_mbps, 1, 0.2);
  ASSERT_TRUE(whole.seen.has_value());
  EXPECT_GT(whole.seen->mean, 0.3);
  EXPECT_LE(whole.seen->mean, 1);
}

TEST(SteadyState, SightShadesBothLayersAsTheRendererDraws) {
  const Remembered& m = remembered();
  const DecodedScene& scene = m.whole.shown.at(0);
  auto renderer = render::Renderer::create();
  ASSERT_TRUE(renderer.ok()) << renderer.error().message;
  const LumaTexture texture = luma_texture({scene.views, scene.textures});
  for (const render::Viewpoint& view : m.trial.plan().views)
    EXPECT_GT(compare_with_renderer(*renderer, scene, texture, view).shaded, 0.995) << view.name;
}

TEST(GeometryBuffer, AppliesTheGainOfATile) {
  DecodedScene scene = measured().stream.shown[0];
  scene.views.front().gain = {1.25f, 0.8f, 1.1f};
  auto renderer = render::Renderer::create();
  ASSERT_TRUE(renderer.ok()) << renderer.error().message;
  const LumaTexture texture = luma_texture({scene.views, scene.textures});
  const render::Viewpoint& view = measured().trial.plan().views.front();
  EXPECT_GT(compare_with_renderer(*renderer, scene, texture, view).shaded, 0.995);
}

TEST(Seen, IsWhatASensorSeesNowOrSawBefore) {
  const Remembered& m = remembered();
  Moments moments = m.trial.moments();
  const auto masks = [&] {
    const auto made = seen_masks(m.trial.scene(), moments, {0}, m.trial.plan().views, {});
    return made ? made->front() : std::vector<ImageMask>(4);
  };
  const std::vector<ImageMask> by_then = masks();
  moments.first = {moments.shown(0)}, moments.burst = 1, moments.warm_up = 0;
  const std::vector<ImageMask> now = masks();
  std::size_t pixels = 0, then_pixels = 0, now_pixels = 0;
  for (std::size_t v = 0; v < now.size(); ++v) {
    ASSERT_EQ(by_then[v].data.size(), 160u * 120u);
    pixels += by_then[v].data.size();
    then_pixels += static_cast<std::size_t>(std::ranges::count(by_then[v].data, 1));
    now_pixels += static_cast<std::size_t>(std::ranges::count(now[v].data, 1));
  }
  EXPECT_GT(now_pixels, pixels / 4);
  EXPECT_GT(then_pixels, now_pixels) << "people walk";
  EXPECT_LT(then_pixels, pixels) << "nobody looks under the table";
}

}  // namespace
}  // namespace mr::eval
