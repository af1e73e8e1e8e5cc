#include "mr/node/sources.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace mr::node {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(PrepareScene, RefusesInOneLineWhatCannotBe) {
  Scene scene;
  scene.id = "made";
  scene.rig.emplace().sensors = 2;
  scene.mergers = {{.id = "root", .inputs = scene.rig->sensor_ids()}};
  ASSERT_TRUE(prepare_scene(scene)) << prepare_scene(scene).error().message;

  scene.simplify.ratio = 2;
  const auto one = prepare_scene(scene);
  ASSERT_FALSE(one);
  EXPECT_EQ(one.error().cause, Error::Cause::invalid);
  EXPECT_EQ(one.error().message,
            "scene 'made': simplify.ratio must be greater than 0 and at most 1, not 2");

  scene.atlas.width = scene.atlas.height = 0;
  const auto more = prepare_scene(scene);
  ASSERT_FALSE(more);
  EXPECT_THAT(more.error().message, HasSubstr("(and 2 more problems)"));
  EXPECT_THAT(more.error().message, Not(HasSubstr("\n")));
}

TEST(PrepareScene, NeedsSensors) {
  const auto none = prepare_scene({});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().cause, Error::Cause::empty);
}

}  // namespace
}  // namespace mr::node
