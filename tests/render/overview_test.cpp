#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "mr/render/renderer.h"
#include "support/meshes.h"

namespace mr::render {
namespace {

DecodedScene box_scene() {
  Chunk chunk;
  chunk.mesh = test::box({-1, -2, 0}, {3, 2, 2.5f});
  DecodedScene scene;
  scene.chunks.push_back(std::make_shared<Chunk>(chunk));
  for (const SensorId id : {SensorId{2}, SensorId{5}}) {
    View view;
    view.id = view_of(id);
    view.width = 640, view.height = 360;
    view.fx = view.fy = 500, view.cx = 300, view.cy = 170;
    view.T_world_camera = look_at({number_of(id) - 3.0, -1, 1}, {1, 1, 1}, {0, 0, 1});
    scene.views.push_back(view);
    SourceInfo source;
    source.sensor = id;
    source.T_world_depth = view.T_world_camera;
    scene.sources.push_back(source);
  }
  return scene;
}

TEST(Overview, HasTheDocumentedViewpoints) {
  std::vector<std::string> names;
  for (const Viewpoint& v : overview(box_scene(), {0, 0, 1})) names.push_back(v.name);
  EXPECT_THAT(names, testing::ElementsAre("view_2", "view_5", "outside_0", "outside_1", "outside_2",
                                          "outside_3", "above", "middle"));
}

TEST(Overview, CamerasOutsideSeeTheWholeBoxForAnyUp) {
  const DecodedScene scene = box_scene();
  for (const Vec3d up : {Vec3d{0, 0, 1}, Vec3d{0, -1, 0}, Vec3d{1, 0, 0}})
    for (const Viewpoint& v : overview(scene, up, 320, 240)) {
      EXPECT_TRUE(pose_from_matrix(v.T_world_camera.matrix(), 1e-9).ok()) << v.name;
      if (!v.name.starts_with("outside") && v.name != "above") continue;
      EXPECT_GT(dot(v.T_world_camera.translation - Vec3d{1, 0, 1.25}, up), 2) << v.name;
      for (const Vec3f corner : scene.chunks[0]->mesh.positions) {
        const auto at = project(v.camera, v.T_world_camera.inverse() * vec_cast<double>(corner));
        ASSERT_TRUE(at) << v.name;
        EXPECT_TRUE(at->x >= 0 && at->y >= 0 && at->x <= 319 && at->y <= 239) << v.name;
      }
    }
}

TEST(Overview, ASensorsPictureFitsAndIsCentred) {
  const DecodedScene scene = box_scene();
  const Viewpoint v = overview(scene, {0, 0, 1}, 320, 240)[0];
  const Camera from = scene.views[0].camera();
  const auto moved = [&](Vec2d pixel) { return *project(v.camera, unproject(from, pixel)); };
  EXPECT_NEAR(moved({-0.5, -0.5}).x, -0.5, 1e-9);  // 640 x 360 becomes 320 x 180,
  EXPECT_NEAR(moved({-0.5, -0.5}).y, 29.5, 1e-9);  // with 30 rows above and below
  EXPECT_NEAR(moved({639.5, 359.5}).x, 319.5, 1e-9);
  EXPECT_NEAR(moved({639.5, 359.5}).y, 209.5, 1e-9);
}

TEST(Overview, SensorsThatLookAtEachOtherStillGiveAMiddle) {
  DecodedScene scene = box_scene();
  scene.sources[0].T_world_depth = look_at({-2, 0, 1}, {0, 0, 1}, {0, 0, 1});
  scene.sources[1].T_world_depth = look_at({2, 0, 1}, {0, 0, 1}, {0, 0, 1});
  const Viewpoint v = overview(scene, {0, 0, 1}).back();
  EXPECT_EQ(v.name, "middle");
  EXPECT_NEAR(length(v.T_world_camera.translation - Vec3d{0, 0, 1}), 0, 1e-9);
  EXPECT_TRUE(pose_from_matrix(v.T_world_camera.matrix(), 1e-9).ok());
}

TEST(Overview, OfNothingIsNothing) { EXPECT_TRUE(overview({}, {0, 0, 1}).empty()); }

}  // namespace
}  // namespace mr::render
