#include "mr/rate/room.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "mr/rate/backlog_share.h"
#include "mr/rate/curve_predictor.h"
#include "mr/rate/evaluation.h"
#include "mr/rate/simulation.h"
#include "rate/made_stream.h"
#include "rate/made_sweeps.h"

namespace mr::rate {
namespace {

TEST(RoomValues, AreThoseOfTheSweepAtItsNodesAndBetweenThem) {
  const MadeScene scene;
  const RoomValues room = room_values(made_sweep(scene));
  for (const int qp : kPlateNodes_qp) {
    EXPECT_NEAR(room.plate_loss_at(qp), made_plate_loss(scene, qp), 1e-9);
  }
  EXPECT_NEAR(room.plate_bytes[2], made_plate_bytes(scene, kPlateNodes_qp[2]), 1e-6);
  EXPECT_NEAR(room.plate_loss_at(31), made_plate_loss(scene, 31), 5e-4);
  EXPECT_NEAR(room.still_bytes, made_still_bytes(0.35), 1e-6);
  EXPECT_NEAR(room.still_loss_at(1), made_still_loss(1), 1e-9);
  EXPECT_EQ(room.plate_loss_at(51), room.plate_loss_at(44));
  EXPECT_EQ(room.still_loss_at(6), room.still_loss_at(3));
}

TEST(RoomValues, OfASceneWithoutARoomNothingIsLost) {
  const RoomValues room = room_values(made_sweep({.layers = false}));
  EXPECT_EQ(loss_of({100, 100, 100, 44, 20}, room, 4), 0);
}

TEST(LossOf, FallsAsTheBacklogIsSent) {
  const MadeScene scene;
  const RoomValues room = room_values(made_sweep(scene));
  EXPECT_NEAR(loss_of({0, 1e5, 0, 44, 20}, room, 1),
              made_plate_loss(scene, 44) - made_plate_loss(scene, 20), 1e-9);
  const double half = made_still_bytes(0.35) / 2;
  EXPECT_NEAR(loss_of({half, 0, half, 20, 20}, room, 3), made_still_loss(3) / 2, 1e-9);
  EXPECT_EQ(loss_of({half, 0, 0, 20, 20}, room, 3), 0) << "other still surface is shown";
  EXPECT_EQ(loss_of({}, room, 3), 0);
  EXPECT_EQ(loss_of({0, 1e5, 0, 20, 28}, room, 3), 0) << "finer than they are going to be";
}

/// Quality that falls with the square of what is lacking of 10 Mbit/s.
std::vector<RatePoint> square_law(double by) {
  std::vector<RatePoint> out;
  for (double mbps = 1; mbps <= 10; mbps += 0.05)
    out.push_back({{}, mbps, 0.9 - by * std::pow(1 - mbps / 10, 2)});
  return out;
}

TEST(ShareUntilSent, IsWhereTheSumOfBothLossesIsLeast) {
  // Of (by s^2 + lacking) / s, that is at the root of lacking / by.
  for (const double share : {0.2, 0.35, 0.5})
    for (const double by : {0.05, 0.2})
      EXPECT_NEAR(share_until_sent(square_law(by), 10, by * share * share), share, 0.051)
          << share << ' ' << by;
}

TEST(ShareUntilSent, StaysWithinItsLimits) {
  EXPECT_EQ(share_until_sent(square_law(0.1), 10, 0), kLeastBacklogShare);
  EXPECT_NEAR(share_until_sent(square_law(0.1), 10, 1), kMostBacklogShare, 1e-9);
  EXPECT_NEAR(share_until_sent(square_law(0.1), 0.5, 0.1), kMostBacklogShare, 1e-9)
      << "captures are left out whatever the share";
}

TEST(CurvePredictor, PredictsTheRoomOfOtherScenes) {
  for (const MadeScene& scene : made_other_scenes()) {
    if (!scene.layers) continue;
    const Sweep sweep = made_sweep(scene);
    Observation observed;
    observed.features = sweep.features;
    const RoomValues got = CurvePredictor::train(made_training()).predict_room(observed);
    for (std::size_t i = 0; i < got.plate_bytes.size(); ++i) {
      const int qp = kPlateNodes_qp[i];
      EXPECT_NEAR(std::log(got.plate_bytes[i] / made_plate_bytes(scene, qp)), 0, 0.3) << qp;
      EXPECT_NEAR(got.plate_loss[i], made_plate_loss(scene, qp),
                  0.003 + 0.3 * made_plate_loss(scene, qp))
          << scene.name << ' ' << qp;
    }
    EXPECT_TRUE(std::ranges::is_sorted(got.plate_loss));
    EXPECT_NEAR(got.still_bytes / made_still_bytes(0.35), 1, 0.05);
    EXPECT_NEAR(got.still_loss_at(3), made_still_loss(3), 0.002);
  }
}

TEST(RoomError, IsNothingWhereAllRoomsAreTheSame) {
  std::vector<Sweep> sweeps = made_training();
  for (Sweep& sweep : sweeps)
    if (sweep.layers) sweep.plates = sweeps.front().plates;
  const RoomError same = room_error(sweeps), other = room_error(made_training());
  EXPECT_EQ(same.scenes, made_scenes().size());
  EXPECT_NEAR(same.plate_bytes, 0, 1e-6);
  EXPECT_NEAR(same.still_bytes, 0, 1e-6);
  EXPECT_GT(other.plate_bytes, 0.01);
}

/// Chooses settings as our model does, but gives a backlog always the same share.
class FixedShare final : public Model {
 public:
  explicit FixedShare(double share) : share_(share) {}
  Setting choose(const Observation& observed, double mbps) const override {
    return made_model()->choose(observed, mbps);
  }
  double backlog_share(const Observation&, const Backlog&, double) const override { return share_; }

 private:
  double share_;
};

/// What is lost in the seconds of a burst, against all of the room in the best quality.
double lost(std::shared_ptr<const Model> model, const MadeScene& scene, double target_mbps) {
  Controller controller(std::move(model), true, scene.fps, target_mbps);
  const std::vector<Burst> burst{{5, target_mbps * 1e6 / 8, true, 1, 2 * target_mbps * 1e6 / 8}};
  const Trace trace{"made", [=](double) { return target_mbps; }};
  const auto result = simulate(controller, made_sweep(scene), trace, burst, 40, 1);
  double out = 0;
  for (std::size_t i = 5; i < result.seconds.size(); ++i)
    out += made_ssim(scene, 0.5, 1, 18) - result.seconds[i].ssim + result.seconds[i].lacking;
  return out;
}

TEST(Simulation, TheModelsShareLosesLessInABurstThanAnyFixedOne) {
  double best_fixed = 1e9;
  const auto over_scenes = [](const std::shared_ptr<const Model>& model) {
    double sum = 0;
    for (const MadeScene& scene : made_other_scenes())
      if (scene.layers)
        for (const double share : {0.3, 0.6})
          sum += lost(model, scene,
                      made_least_mbps(scene) *
                          std::pow(made_most_mbps(scene) / made_least_mbps(scene), share));
    return sum;
  };
  const double of_model = over_scenes(made_model());
  RecordProperty("model", std::to_string(of_model));
  for (const double share : {0.1, 0.2, 0.35, 0.5, 0.65}) {
    const double of_share = over_scenes(std::make_shared<FixedShare>(share));
    RecordProperty("share_" + std::to_string(share), std::to_string(of_share));
    best_fixed = std::min(best_fixed, of_share);
  }
  EXPECT_LT(of_model, best_fixed);
}

}  // namespace
}  // namespace mr::rate
