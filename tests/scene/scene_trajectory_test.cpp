#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scene/scene_file.h"

namespace mr {
namespace {

using namespace std::chrono_literals;
using test::kIdentity;
using test::long_sensor;
using test::SceneFile;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr const char* kTwo = "{type: rgbd-images, depth: [d.png, d.png]}";

std::string line16(int x) { return "1 0 0 " + std::to_string(x) + " 0 1 0 0 0 0 1 0 0 0 0 1\n"; }

TEST_F(SceneFile, PosesOfAllItemsComeFromOneFile) {
  dir_.write("traj.txt", line16(1) + line16(2));
  const SceneResult two = load(long_sensor(kTwo, "{trajectory: traj.txt}"));
  EXPECT_THAT(shorten(two.problems), IsEmpty());
  const SensorConfig& sensor = two.scene.sensors.at(0);
  ASSERT_EQ(sensor.T_world_depth.size(), 2u);
  EXPECT_EQ(sensor.pose_of(1, {})->translation, (Vec3d{2, 0, 0}));
  EXPECT_TRUE(sensor.is_moving());

  dir_.write("traj.txt", line16(1) + "nan" + line16(2).substr(1));
  const SceneResult lost = load(long_sensor(kTwo, "{trajectory: traj.txt}"));
  EXPECT_THAT(shorten(lost.problems), IsEmpty());
  EXPECT_THAT(shorten(lost.notices),
              ElementsAre(AllOf(HasSubstr("6: sensors.a.T_world_depth: 1 of the 2 poses"),
                                HasSubstr("traj.txt: line 2"))));
  EXPECT_TRUE(lost.scene.sensors[0].pose_of(0, {}));
  EXPECT_FALSE(lost.scene.sensors[0].pose_of(1, {}));

  dir_.write("traj.txt", line16(1) + line16(2) + line16(3));
  EXPECT_THAT(problems(long_sensor(kTwo, "{trajectory: traj.txt}")),
              ElementsAre(HasSubstr("T_world_depth holds 3 poses for 2 items")));
}

TEST_F(SceneFile, TrajectoriesOfAnotherFrameAreMovedToTheDepthCamera) {
  // The trajectory's frame stands at x = 5 and is turned a quarter about z; the camera is 1 m along
  // its x axis: 1 m along the world's y.
  dir_.write("traj.txt", "0 -1 0 5 1 0 0 0 0 0 1 0 0 0 0 1\n");
  const SceneResult moved =
      load(long_sensor(kTwo,
                       "{trajectory: traj.txt, T_trajectory_depth: [1,0,0,1, 0,1,0,0, 0,0,1,0, "
                       "0,0,0,1]}"));
  EXPECT_THAT(shorten(moved.problems), IsEmpty());
  EXPECT_EQ(moved.scene.sensors.at(0).T_world_depth.at(0).translation, (Vec3d{5, 1, 0}));
  EXPECT_THAT(problems(long_sensor(kTwo, "{trajectory: traj.txt, T_trajectory_depth: [1]}")),
              ElementsAre(HasSubstr("T_trajectory_depth must be a list of 16 numbers")));
}

TEST_F(SceneFile, PosesWithTimesAreATrajectory) {
  std::string text = "# time position quaternion\n";
  for (int i = 0; i <= 1000; ++i)
    text += std::to_string(i / 100.0) + " " + std::to_string(i / 100.0) + " 0 0 0 0 0 1\n";
  dir_.write("groundtruth.txt", text);
  const SceneResult timed = load(long_sensor(kTwo, "{trajectory: groundtruth.txt}"));
  EXPECT_THAT(shorten(timed.problems), IsEmpty());
  const SensorConfig& sensor = timed.scene.sensors.at(0);
  EXPECT_EQ(sensor.trajectory.poses().size(), 1001u);
  EXPECT_NEAR(sensor.pose_of(0, TimePoint(2505ms))->translation.x, 2.505, 1e-9);
  ASSERT_EQ(sensor.T_world_depth.size(), 256u) << "where the sensor goes";
  EXPECT_EQ(sensor.T_world_depth.front().translation.x, 0);
  EXPECT_EQ(sensor.T_world_depth.back().translation.x, 10);

  dir_.write("groundtruth.txt", "1305031098.5 0 0 0 0 0 0 1\n");
  EXPECT_THAT(problems(long_sensor(kTwo, "{trajectory: groundtruth.txt}")),
              ElementsAre(AllOf(HasSubstr("6: T_world_depth: "), HasSubstr("1305031098.5"),
                                HasSubstr("no times of its own"))));
}

TEST_F(SceneFile, ProblemsOfATrajectoryNameItsFile) {
  dir_.write("bad.txt", "1 2 3 4 5\n");
  EXPECT_THAT(problems(long_sensor(kTwo, "{trajectory: bad.txt}")),
              ElementsAre(AllOf(HasSubstr("6: T_world_depth: "), HasSubstr("bad.txt: line 1"))));
  EXPECT_THAT(problems(long_sensor(kTwo, "{trajectory: none.txt}")),
              ElementsAre(AllOf(HasSubstr("no such file"), HasSubstr("none.txt"))));
  EXPECT_THAT(problems(long_sensor(kTwo, "{trajectory: bad.txt, file: bad.txt}")),
              ElementsAre(HasSubstr("one of file, files, pattern, trajectory")));
}

TEST_F(SceneFile, ASensorMayBeMovingAndHaveAClockThatDrifts) {
  const SceneResult still = load(long_sensor(kTwo));
  EXPECT_FALSE(still.scene.sensors.at(0).is_moving());
  EXPECT_EQ(still.scene.sensors.at(0).clock_drift_ppm, 0);
  const SceneResult moving =
      load(long_sensor(kTwo, kIdentity, "    moving: true\n    clock_drift_ppm: -12.5\n"));
  EXPECT_THAT(shorten(moving.problems), IsEmpty());
  EXPECT_TRUE(moving.scene.sensors.at(0).is_moving());
  EXPECT_EQ(moving.scene.sensors.at(0).clock_drift_ppm, -12.5);
  EXPECT_THAT(problems(long_sensor(kTwo, kIdentity, "    moving: perhaps\n")),
              ElementsAre(HasSubstr("7: moving")));
  EXPECT_THAT(problems(long_sensor(kTwo, kIdentity, "    clock_drift_ppm: 1001\n")),
              ElementsAre(AllOf(HasSubstr("7: clock_drift_ppm"), HasSubstr("1000"))));
}

}  // namespace
}  // namespace mr
