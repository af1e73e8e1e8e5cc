#include "mr/rate/controller.h"

#include <gtest/gtest.h>

#include <utility>

#include <cmath>
#include <limits>

#include "rate/made_stream.h"

namespace mr::rate {
namespace {

constexpr double kShares[] = {0.15, 0.35, 0.6, 0.85};  // of the way from the least rate to the most

double target_at(const MadeScene& scene, double share) {
  const double least = made_least_mbps(scene);
  return least * std::pow(made_most_mbps(scene) / least, share);
}

TEST(Controller, UsesTheTargetWhereTheSceneCould) {
  for (const MadeScene& scene : made_other_scenes())
    for (const double share : kShares) {
      const double target = target_at(scene, share);
      MadeStream stream(scene, target);
      stream.run(20);
      EXPECT_NEAR(stream.mbps(1, 20) / target, 1, 0.03) << scene.name << " at " << share;
    }
}

TEST(Controller, NoSecondIsOverItsTargetKeyFramesIncluded) {
  for (const MadeScene& scene : made_other_scenes())
    for (const double share : kShares)
      for (const std::size_t key_frame_every : {30, 77, 250}) {
        const double target = target_at(scene, share);
        MadeStream stream(scene, target);
        stream.key_frame_every = key_frame_every;
        stream.run(15);
        for (double s = 1; s < 13.9; s += 1 / scene.fps)  // any second, not only whole ones
          ASSERT_LE(stream.mbps(s, s + 1), 1.1 * target) << scene.name << ' ' << share << ' ' << s;
      }
}

TEST(Controller, BeyondTheBestQualityItTakesThatAndNoMore) {
  for (const MadeScene& scene : made_other_scenes()) {
    MadeStream stream(scene, 5 * made_most_mbps(scene));
    stream.key_frame_every = 0;
    stream.run(10);
    for (std::size_t i = 150; i < 300; ++i) {
      EXPECT_EQ(stream.captures[i].plan.setting.qp, 18) << scene.name;
      EXPECT_FALSE(stream.captures[i].plan.skipped);
    }
    EXPECT_EQ(stream.captures.back().setting.scale, 1) << scene.name;
    EXPECT_LT(stream.mbps(5, 10), 1.1 * made_most_mbps(scene));
    EXPECT_FALSE(stream.controller.is_best_effort());
  }
}

TEST(Controller, FollowsAStepDownWithin300ms) {
  for (const MadeScene& scene : made_other_scenes())
    for (const auto& [from, to] : {std::pair{0.9, 0.3}, {0.9, 0.6}, {0.5, 0.15}, {3.0, 0.2}}) {
      MadeStream stream(scene, target_at(scene, from));
      stream.run(8);
      const double target = target_at(scene, to);
      stream.controller.set_target(target);
      stream.run(5);
      for (double s = 8.3; s < 12.6; s += 0.1)
        EXPECT_LT(stream.mbps(s, s + 0.3), 1.15 * target)
            << scene.name << " from " << from << " to " << to << ' ' << s - 8 << " s after it";
      EXPECT_NEAR(stream.mbps(9, 13) / target, 1, 0.05) << scene.name << ' ' << from << ' ' << to;
    }
}

TEST(Controller, FollowsAStepUp) {
  for (const MadeScene& scene : made_other_scenes()) {
    MadeStream stream(scene, target_at(scene, 0.2));
    stream.run(8);
    const double target = target_at(scene, 0.8);
    stream.controller.set_target(target);
    stream.run(5);
    EXPECT_NEAR(stream.mbps(9, 13) / target, 1, 0.03) << scene.name;
  }
}

TEST(Controller, BelowTheLeastItLeavesOutCapturesAndSaysSo) {
  for (const MadeScene& scene : made_other_scenes())
    for (const double part : {0.6, 0.3, 0.1, 0.02}) {
      MadeStream stream(scene, part * made_least_mbps(scene));
      stream.key_frame_every = 0;
      stream.run(20);
      int skipped = 0;
      double sent_s = 0, longest_s = 0;
      for (std::size_t i = 60; i < stream.captures.size(); ++i) {
        const bool is_skipped = stream.captures[i].plan.skipped;
        const double s = static_cast<double>(i) / scene.fps;
        skipped += is_skipped;
        if (!is_skipped || sent_s == 0) sent_s = s;
        longest_s = std::max(longest_s, s - sent_s);
      }
      EXPECT_TRUE(stream.controller.is_best_effort()) << scene.name << ' ' << part;
      EXPECT_GT(skipped, 0) << scene.name << ' ' << part;
      EXPECT_LE(longest_s, 2) << scene.name << ' ' << part;
      if (part >= 0.1) {
        EXPECT_LT(stream.mbps(2, 20), 1.1 * part * made_least_mbps(scene)) << scene.name;
      }
    }
}

TEST(Controller, FindsTheSettingThatFitsSoonWhereTheFirstLeavesMostCapturesOut) {
  // Everything moves: at the first error the mesh alone takes several times the target.
  MadeScene scene{"start", true, 30, 1, 0.095, 1.2, 6};
  const double first = made_geometry_bytes(scene, kUsualSetting.error_voxels) * scene.fps * 8e-6;
  const double target = 1.15 * made_least_mbps(scene);
  ASSERT_GT(first, 2 * target);
  MadeStream stream(scene, target);
  stream.key_frame_every = 0;
  stream.run(4);
  int skipped = 0;
  for (std::size_t i = 45; i < stream.captures.size(); ++i)
    skipped += stream.captures[i].plan.skipped;
  EXPECT_LE(skipped, 4) << "in the last two and a half seconds";
  EXPECT_NEAR(stream.mbps(1, 4) / target, 1, 0.05);
}

TEST(Controller, RecoversFromATargetThatWasTooLow) {
  const MadeScene scene;
  for (const double low : {0.3, 0.02}) {
    MadeStream stream(scene, low * made_least_mbps(scene));
    stream.run(6);
    const double target = target_at(scene, 0.5);
    stream.controller.set_target(target);
    stream.run(6);
    EXPECT_FALSE(stream.controller.is_best_effort());
    EXPECT_NEAR(stream.mbps(8, 12) / target, 1, 0.03) << low;
  }
}

TEST(Controller, AnyTargetGivesPlansThatCanBeCarriedOut) {
  for (const double bad : {kNan, 0.0, -3.0, kInfinite, -kInfinite, 1e300, 1e-300}) {
    const MadeScene scene;
    MadeStream stream(scene, bad);
    stream.backlog = 1e5;
    for (const double target : {bad, 3.0, bad, 3.0}) {
      stream.controller.set_target(target);
      EXPECT_GT(stream.controller.target_mbps(), 0);
      EXPECT_TRUE(std::isfinite(stream.controller.target_mbps())) << target;
      stream.run(3);
    }
    for (const auto& [plan, setting, target, mbps, backlog, share, best_effort] : stream.captures) {
      EXPECT_TRUE(share >= 0 && share <= kMostBacklogShare + 1e-9) << share;
      EXPECT_TRUE(plan.setting.qp >= 18 && plan.setting.qp <= 51) << plan.setting.qp;
      EXPECT_TRUE(plan.refinement >= 0 && plan.refinement <= backlog) << plan.refinement;
    }
    EXPECT_NEAR(stream.mbps(10, 12), 3, 0.3) << bad;
  }
}

TEST(Controller, NotFiniteAndNotPositiveTargetsAreTheLeast) {
  MadeStream least({}, 1e-9);
  for (const double bad : {kNan, 0.0, -3.0, kInfinite, -kInfinite}) {
    least.controller.set_target(5);
    least.controller.set_target(bad);
    EXPECT_EQ(least.controller.target_mbps(), MadeStream({}, 1e-9).controller.target_mbps());
  }
}

TEST(Controller, TheBacklogIsSentAndGetsItsShare) {
  for (const MadeScene& scene : made_other_scenes())
    for (const double share : {0.35, 0.7}) {
      const double target = target_at(scene, share);
      MadeStream stream(scene, target);
      stream.run(5);
      stream.backlog = 4 * target * 1e6 / 8;  // four seconds of the target
      stream.run(4 / kLeastBacklogShare + 2);
      EXPECT_LT(stream.backlog, 1) << scene.name << ' ' << share;
      for (std::size_t i = 180; i + 30 < stream.captures.size(); i += 30) {
        double refinement = 0, given = 0;
        for (std::size_t k = i; k < i + 30; ++k) {
          refinement += stream.captures[k].backlog - stream.captures[k + 1].backlog;
          given += stream.captures[k].backlog_share / 30;
        }
        if (stream.captures[i + 30].backlog > 0) {
          EXPECT_GE(refinement * 8e-6, 0.9 * given * target)
              << scene.name << ' ' << share << " capture " << i;
        }
        EXPECT_LE(stream.mbps(i / 30.0, i / 30.0 + 1), 1.1 * target) << scene.name;
      }
    }
}

TEST(Controller, TheCoarserThePlatesTheMoreTheyGet) {
  for (const MadeScene& scene : made_other_scenes()) {
    if (!scene.layers) continue;
    double before = 0;
    for (const double qp : {20.5, 26.0, 44.0}) {
      MadeStream stream(scene, target_at(scene, 0.4));
      stream.run(4);
      stream.backlog = 1e7, stream.backlog_qp = qp;
      stream.run(1);
      EXPECT_GT(stream.controller.backlog_share(), before) << scene.name << ' ' << qp;
      before = stream.controller.backlog_share();
    }
    EXPECT_LE(before, kMostBacklogShare + 1e-9);
  }
}

TEST(Controller, WhatIsSavedForThePlatesLeavesOutNoCapture) {
  for (const MadeScene& scene : made_other_scenes())
    for (const double qp : {20.5, 26.0, 44.0}) {
      MadeStream stream(scene, target_at(scene, 0.4));
      stream.backlog = 1e7, stream.backlog_qp = qp;
      stream.least_piece = 1e9;  // it never goes
      stream.run(15);
      int left_out = 0;
      for (std::size_t i = 150; i < stream.captures.size(); ++i)
        left_out += stream.captures[i].plan.skipped;
      EXPECT_EQ(left_out, 0) << scene.name << ' ' << qp;
    }
}

TEST(Controller, WhatWasChosenInABurstIsTakenBackSoonAfterIt) {
  for (const MadeScene& scene : made_other_scenes()) {
    const double target = target_at(scene, 0.6);
    MadeStream stream(scene, target);
    stream.run(5);
    const Setting usual = stream.controller.setting();
    stream.scene.moving = 5 * scene.moving;  // the room is pushed, and moves as a whole
    stream.run(3);
    ASSERT_GT(stream.controller.setting().error_voxels, usual.error_voxels) << scene.name;
    stream.scene.moving = scene.moving;
    stream.run(3);
    EXPECT_LE(stream.controller.setting().error_voxels, 1.5 * usual.error_voxels) << scene.name;
  }
}

TEST(Controller, TheBacklogGetsItsShareBelowTheLeast) {
  for (const MadeScene& scene : made_other_scenes()) {
    const double target = 0.5 * made_least_mbps(scene);
    MadeStream stream(scene, target);
    stream.key_frame_every = 0;
    stream.run(3);
    stream.backlog = 6 * target * 1e6 / 8;
    stream.run(6);
    const double sent = 6 - stream.backlog * 8e-6 / target;
    double given = 0;  // seconds of the target
    for (std::size_t i = 90; i < stream.captures.size(); ++i)
      given += stream.captures[i].backlog_share / scene.fps;
    EXPECT_GE(given, 6 * kLeastBacklogShare) << scene.name;
    EXPECT_GT(sent, 0.8 * given) << scene.name;
    EXPECT_LT(stream.mbps(3, 9), 1.1 * target) << scene.name;
  }
}

TEST(Controller, FollowsAStepDownWhileABacklogWaits) {
  for (const MadeScene& scene : made_other_scenes()) {
    MadeStream stream(scene, 3 * made_most_mbps(scene));
    stream.key_frame_every = 0;
    stream.least_piece = 1e9;  // it is saved for, and never goes
    stream.backlog = 1e7;
    stream.run(6);
    const double target = target_at(scene, 0.4);
    stream.controller.set_target(target);
    stream.least_piece = 0;
    stream.run(6);
    for (double s = 6.3; s < 10.6; s += 0.1)
      EXPECT_LT(stream.mbps(s, s + 1), 1.15 * target) << scene.name << ' ' << s;
    EXPECT_GT(stream.mbps(7, 12), 0.9 * target) << scene.name;
  }
}

TEST(Controller, ABacklogInLargePiecesIsSavedFor) {
  for (const MadeScene& scene : made_other_scenes()) {
    const double target = target_at(scene, 0.5);
    MadeStream stream(scene, target);
    stream.run(5);
    stream.backlog = 2 * target * 1e6 / 8;
    stream.least_piece = 0.35 * target * 1e6 / 8;
    stream.run(10);
    EXPECT_LT(stream.backlog, stream.least_piece) << scene.name;
    for (double s = 1; s < 13.9; s += 1 / scene.fps)
      ASSERT_LE(stream.mbps(s, s + 1), 1.1 * target) << scene.name << ' ' << s;
  }
}

TEST(Controller, KeepsToTheTargetWhereFewerCapturesComeThanUsual) {
  for (const MadeScene& scene : made_other_scenes())
    for (const double fps : {3.0, 9.0, 20.0}) {
      const double target = target_at(scene, 0.4);
      MadeStream stream(scene, target);
      stream.key_frame_every = 0;
      stream.controller.set_fps(fps);
      stream.run(20);
      const double most =
          fps * 8e-6 * (made_geometry_bytes(scene, 0.5) + made_texture_bytes(scene, 1, 18));
      const double mbps = stream.mbps(5, 20) * fps / scene.fps;
      EXPECT_NEAR(mbps / std::min(target, most), 1, 0.05) << scene.name << ' ' << fps;
    }
}

TEST(Controller, ALeastErrorHoldsForAllSettings) {
  MadeStream stream({}, 1.2 * made_most_mbps({}));
  stream.run(2);
  EXPECT_LT(stream.controller.setting().error_voxels, 2);
  stream.controller.set_least_error(2);
  EXPECT_EQ(stream.controller.setting().error_voxels, 2);
  stream.run(5);
  EXPECT_GE(stream.controller.setting().error_voxels, 2);
  stream.controller.set_least_error(0);
  stream.run(15);
  EXPECT_LT(stream.controller.setting().error_voxels, 2);
}

TEST(Controller, ASceneInWhichNothingMovesLeavesAllToTheBacklog) {
  MadeScene still;
  still.moving = 1e-9;
  MadeStream stream(still, 4);
  stream.backlog = 4e6;
  stream.run(10);
  EXPECT_NEAR(stream.mbps(1, 8), 4, 0.2) << "until the backlog is sent";
  EXPECT_EQ(stream.backlog, 0);
}

TEST(Controller, WorksAtAnyFrameRate) {
  for (const double fps : {5.0, 15.0, 29.97, 60.0}) {
    MadeScene scene;
    scene.fps = fps;
    const double target = target_at(scene, 0.5);
    MadeStream stream(scene, target);
    stream.key_frame_every = 0;
    stream.run(60);
    EXPECT_NEAR(stream.mbps(10, 60) / target, 1, 0.05) << fps;
  }
}

TEST(Controller, SameInputsGiveTheSamePlans) {
  MadeStream a({}, 3), b({}, 3);
  for (MadeStream* stream : {&a, &b}) {
    stream->backlog = 1e6;
    for (const double target : {3.0, 1.2, 6.0}) {
      stream->controller.set_target(target);
      stream->run(4);
    }
  }
  for (std::size_t i = 0; i < a.captures.size(); ++i) {
    EXPECT_EQ(a.captures[i].plan.setting, b.captures[i].plan.setting);
    EXPECT_EQ(a.captures[i].plan.skipped, b.captures[i].plan.skipped);
    EXPECT_EQ(a.captures[i].plan.refinement, b.captures[i].plan.refinement);
  }
}

TEST(Controller, AnotherTextureScaleIsAKeyFrame) {
  const MadeScene scene = made_other_scenes()[0];
  MadeStream stream(scene, 0.9 * made_most_mbps(scene));
  stream.key_frame_every = 0;
  stream.run(5);
  stream.controller.set_target(1.3 * made_least_mbps(scene));
  stream.run(5);
  int changes = 0, keys = 0;
  double scale = stream.captures.front().plan.setting.scale;
  for (const MadeStream::Capture& capture : stream.captures) {
    if (capture.plan.skipped) continue;
    changes += std::exchange(scale, capture.plan.setting.scale) != capture.plan.setting.scale;
    keys += capture.plan.key_frame;
  }
  EXPECT_GT(changes, 0);
  EXPECT_EQ(keys, 1 + changes) << "the first capture, and one for each";
}

}  // namespace
}  // namespace mr::rate
