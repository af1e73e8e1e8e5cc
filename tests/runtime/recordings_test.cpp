#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "mr/core/mesh.h"
#include "mr/core/parallel.h"
#include "mr/runtime/lockstep_scene.h"
#include "support/shared_data.h"

/// The examples of recordings, from the file to the mesh that a viewer decodes.
namespace mr {
namespace {

double decoded_area_m2(const std::string& example, const std::string& folder_name) {
  const auto folder = test::shared_data();
  if (!std::filesystem::exists(folder / folder_name)) return -1;
  ::setenv("MR_DATA", folder.c_str(), 1);
  const SceneResult loaded =
      load_scene(std::filesystem::path(MR_SOURCE_DIR) / "examples" / example);
  for (const SceneProblem& p : loaded.problems) ADD_FAILURE() << to_string(p);
  if (!loaded.problems.empty()) return 0;
  double area_m2 = 0;
  Arena(2).run([&] {
    auto scene = runtime::LockstepScene::open(loaded.scene);
    ASSERT_TRUE(scene) << scene.error().message;
    const auto report = (*scene)->run(2);
    ASSERT_TRUE(report) << report.error().message;
    EXPECT_TRUE(report->drops.empty());
    EXPECT_FALSE((*scene)->decoded()->textures.empty());
    for (const auto& chunk : (*scene)->decoded()->chunks) area_m2 += surface_area_m2(chunk->mesh);
  });
  return area_m2;
}

TEST(Recordings, AnAzureKinectsDeskBecomesATexturedMesh) {
  const double area_m2 = decoded_area_m2("azure-kinect.yaml", "azure_kinect_mkv");
  if (area_m2 < 0) GTEST_SKIP() << "no recordings (set MR_DATA)";
  EXPECT_GT(area_m2, 3);
  EXPECT_LT(area_m2, 15);
}

TEST(Recordings, AnOustersStreetBecomesATexturedMesh) {
  const double area_m2 = decoded_area_m2("ouster.yaml", "ouster");
  if (area_m2 < 0) GTEST_SKIP() << "no recordings (set MR_DATA)";
  EXPECT_GT(area_m2, 200);
  EXPECT_LT(area_m2, 2000);
}

}  // namespace
}  // namespace mr
