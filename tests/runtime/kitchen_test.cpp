#include <gtest/gtest.h>

#include <filesystem>

#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/render/renderer.h"
#include "mr/runtime/lockstep_scene.h"
#include "support/shared_data.h"

namespace mr {
namespace {

TEST(Kitchen, EightRealViewsBecomeOneTexturedMesh) {
  const std::filesystem::path file =
      std::filesystem::path(MR_SOURCE_DIR) / "examples/red-kitchen.yaml";
  const auto folder = test::shared_data();
  if (!std::filesystem::exists(folder / "sevenscenes_redkitchen"))
    GTEST_SKIP() << "no recordings at " << folder << " (set MR_DATA)";
  ::setenv("MR_DATA", folder.c_str(), 1);

  SceneResult loaded = load_scene(file);
  for (const SceneProblem& p : loaded.problems) ADD_FAILURE() << to_string(p);
  ASSERT_TRUE(loaded.problems.empty());
  Arena arena(2);
  arena.run([&] {
    auto pipeline = runtime::LockstepScene::open(loaded.scene);
    ASSERT_TRUE(pipeline);
    const auto report = (*pipeline)->run(2);
    ASSERT_TRUE(report) << report.error().message;
    EXPECT_EQ(report->frames, 2);
    EXPECT_TRUE(report->drops.empty());
    EXPECT_EQ(report->chunks_new, report->chunks_kept);  // stills: the second frame costs no mesh

    const DecodedScene& scene = *(*pipeline)->decoded();
    Mesh mesh;
    for (const auto& chunk : scene.chunks) append(mesh, chunk->mesh);
    mesh = kit::weld(mesh);
    EXPECT_GT(surface_area_m2(mesh), 15);
    EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
    double textured = 0;
    const auto views = triangle_views(mesh);
    for (std::size_t t = 0; t < views.size(); ++t)
      if (views[t] != kNoView) textured += 0.5 * length(mesh.area_normal(t));
    EXPECT_GT(textured, 0.85 * surface_area_m2(mesh));

    // Drawn from a sensor's own view it looks like that sensor's picture (lighting differs between
    // views).
    auto renderer = render::Renderer::create();
    ASSERT_TRUE(renderer) << renderer.error().message;
    const View& view = scene.views[3];
    const auto drawn =
        renderer->draw(scene, view.camera(), view.T_world_camera, {.background = {0, 255, 0}});
    ASSERT_TRUE(drawn);
    const ImageRgb& atlas = *scene.textures.at(view.stream);
    double difference = 0;
    int compared = 0;
    for (int y = 0; y < view.height; ++y)
      for (int x = 0; x < view.width; ++x) {
        const auto* a = drawn->at(x, y);
        const auto* b = atlas.at(view.atlas_rect.x + x, view.atlas_rect.y + y);
        if ((a[0] == 0 && a[1] == 255) || b[0] + b[1] + b[2] < 30) continue;
        for (int c = 0; c < 3; ++c) difference += std::abs(a[c] - b[c]);
        ++compared;
      }
    EXPECT_GT(compared, view.width * view.height / 4);
    EXPECT_LT(difference / (3.0 * compared), 12);
  });
}

}  // namespace
}  // namespace mr
