#include "mr/core/pose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace mr {
namespace {

/// Turned by 30 degrees about z, then moved.
std::array<double, 16> turned_matrix(double scale = 1) {
  const double c = scale * std::cos(std::acos(-1.0) / 6), s = scale * 0.5;
  return {c, -s, 0, 1, s, c, 0, 2, 0, 0, scale, 3, 0, 0, 0, 1};
}

double deviation(const Mat3& r) {
  const Mat3 gram = transposed(r) * r;
  double worst = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      worst = std::max(worst, std::abs(gram(i, j) - (i == j ? 1.0 : 0.0)));
  return worst;
}

TEST(Pose, MapsAPointAsWorkedOutByHand) {
  const auto pose = pose_from_matrix(std::array<double, 16>{0, -1, 0, 1, 1, 0, 0, 2,  //
                                                            0, 0, 1, 3, 0, 0, 0, 1});
  ASSERT_TRUE(pose);
  const Vec3d p = *pose * Vec3d{10, 20, 30};
  EXPECT_EQ(p, (Vec3d{-19, 12, 33}));
}

TEST(Pose, RepairsARotationThatIsSlightlyOff) {
  std::array<double, 16> m = turned_matrix(0.9997);
  m[1] += 0.002;
  const auto pose = pose_from_matrix(m);
  ASSERT_TRUE(pose) << pose.error().message;
  EXPECT_LT(deviation(pose->rotation), 1e-14);
  EXPECT_NEAR(determinant(pose->rotation), 1, 1e-14);
  EXPECT_EQ(pose->translation, (Vec3d{1, 2, 3}));
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      EXPECT_NEAR(pose->rotation(i, j), turned_matrix()[i * 4 + j], 0.0021);
}

TEST(Pose, AUniformScaleIsRepairedToTheSameRotation) {
  const auto pose = pose_from_matrix(turned_matrix(0.995));
  ASSERT_TRUE(pose);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      EXPECT_NEAR(pose->rotation(i, j), turned_matrix()[i * 4 + j], 1e-12);
}

TEST(Pose, RefusesWhatIsNotRigid) {
  EXPECT_FALSE(pose_from_matrix(turned_matrix(1.05)));
  EXPECT_FALSE(pose_from_matrix(std::array<double, 16>{}));

  auto mirrored = turned_matrix();
  for (const int i : {0, 4, 8}) mirrored[i] = -mirrored[i];
  const auto refused = pose_from_matrix(mirrored);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("mirrored"), std::string::npos);

  auto projective = turned_matrix();
  projective[12] = 0.1;
  EXPECT_FALSE(pose_from_matrix(projective));

  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    auto m = turned_matrix();
    m[3] = bad;
    EXPECT_FALSE(pose_from_matrix(m));
  }
}

TEST(Pose, InverseUndoesAndChains) {
  const Pose a = *pose_from_matrix(turned_matrix());
  const Pose b = look_at({1, 2, 3}, {-2, 0.5, 1}, {0, 0, 1});
  const Vec3d p{0.3, -4, 7};
  EXPECT_LT(length(a.inverse() * (a * p) - p), 1e-14);
  EXPECT_LT(length((a * b) * p - a * (b * p)), 1e-14);
  EXPECT_LT(length((a * b).inverse() * (a * (b * p)) - p), 1e-13);
  EXPECT_EQ(*pose_from_matrix(a.matrix()), a);
}

TEST(Pose, LookAtHasTheTargetAheadAndUpAbove) {
  const Pose T_world_camera = look_at({4, 0, 1}, {0, 0, 1}, {0, 0, 1});
  const Pose T_camera_world = T_world_camera.inverse();
  EXPECT_LT(length(T_camera_world * Vec3d{0, 0, 1} - Vec3d{0, 0, 4}), 1e-14);
  EXPECT_LT((T_camera_world * Vec3d{0, 0, 2}).y, 0) << "y points down";
  EXPECT_GT((T_camera_world * Vec3d{0, 1, 1}).x, 0) << "x points right";
  EXPECT_NEAR(determinant(T_world_camera.rotation), 1, 1e-14);
}

}  // namespace
}  // namespace mr
