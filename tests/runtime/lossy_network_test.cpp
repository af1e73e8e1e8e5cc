#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mr/codec/control.h"
#include "mr/codec/head.h"
#include "mr/net/emulated_transport.h"
#include "mr/node/client_task.h"
#include "mr/node/merge_task.h"
#include "mr/node/sensor_task.h"
#include "mr/node/sources.h"
#include "mr/runtime/paced_frames.h"
#include "mr/runtime/task_steps.h"
#include "support/rig_scene.h"

namespace mr::runtime {
namespace {

using std::chrono::milliseconds;

/// A scene whose nodes are joined by emulated links, in virtual time.
class LinkedScene {
 public:
  LinkedScene(Scene scene, const net::LinkConfig& links)
      : scene_(*node::prepare_scene(std::move(scene))), network_(links) {
    const std::vector<SensorId> all = all_sensors(scene_.sensors);
    auto sources = node::open_sources(scene_, all, {});
    for (const SensorId id : all)
      add(std::make_unique<node::SensorTask>(
          scene_, id,
          std::make_unique<PacedFrames>(std::move(sources[index_of(id)]), scene_.fps, clock_),
          node::NodeLog{}));
    for (const SensorConfig& sensor : scene_.sensors)
      listeners_.push_back(network_.subscribe(
          sensor.id, [this, id = sensor.id,
                      heads = std::make_shared<codec::HeadReader>()](const net::Message& bytes) {
            if (const auto packet = heads->read(*bytes, network_.now())) plans_[id] = packet->plan;
          }));
    for (const MergerConfig& merger : scene_.mergers)
      add(std::make_unique<node::MergeTask>(scene_, merger, node::NodeLog{},
                                            node::MergeTask::Options{}));
    auto client = std::make_unique<node::ClientTask>(scene_, node::NodeLog{});
    client_ = client.get();
    add(std::move(client));
  }

  /// Returns the captures that the client has whole, each once, in the order in which it has them.
  std::vector<TimePoint> run(Duration duration) {
    std::vector<TimePoint> whole;
    for (const TimePoint end = now_ + duration; now_ < end; now_ += milliseconds(10)) {
      network_.advance(now_);
      for (auto& steps : steps_) steps->step(now_), steps->make_packet(now_);
      if (const auto scene = client_->scene())
        if (whole.empty() || whole.back() != scene->captured_at)
          whole.push_back(scene->captured_at);
    }
    return whole;
  }
  TimePoint now() const { return now_; }
  const std::optional<Packet>& newest() const { return client_->newest(); }
  /// The plans in the newest delivered packets of the sensors.
  const std::map<std::string, CodingPlan>& sensor_plans() const { return plans_; }
  /// Sends a request, as a rate controller does.
  void ask(const std::string& node, const codec::Control& control) {
    network_.request(node, net::as_message(codec::encode_control(control)), {});
  }
  std::uint64_t lost() const {
    std::uint64_t out = 0;
    for (const auto& [cause, count] : network_.drops()) out += count;
    return out;
  }

 private:
  void add(std::unique_ptr<node::Task> task) {
    steps_.push_back(std::make_unique<TaskSteps>(*task, network_, clock_, drops_));
    tasks_.push_back(std::move(task));
  }

  Scene scene_;
  TimePoint now_{std::chrono::seconds(1'000'000)};
  node::Clock clock_ = [this] { return now_; };
  DropCounter drops_;
  net::EmulatedTransport network_;
  std::vector<std::unique_ptr<node::Task>> tasks_;
  std::vector<std::unique_ptr<TaskSteps>> steps_;
  node::ClientTask* client_ = nullptr;
  std::map<std::string, CodingPlan> plans_;
  std::vector<std::unique_ptr<net::Subscription>> listeners_;
};

Scene five_a_second() {
  Scene scene = test::rig_scene(test::small_rig(100));
  scene.fps = 5;
  return scene;
}

TEST(LossyNetwork, WithoutLossEveryCaptureArrivesAfterItsDelays) {
  LinkedScene scene(five_a_second(), {.delay = milliseconds(20)});
  const auto whole = scene.run(std::chrono::seconds(4));
  EXPECT_GE(whole.size(), 19u);
  EXPECT_EQ(scene.lost(), 0u);
}

/// Sensors, merger and client all mend what is lost on their own way in, by asking.
TEST(LossyNetwork, LossCostsCapturesButNeverTheScene) {
  const auto run = [](std::uint64_t seed) {
    LinkedScene scene(five_a_second(), {.delay = milliseconds(20), .loss = 0.1, .seed = seed});
    const auto whole = scene.run(std::chrono::seconds(6));
    EXPECT_GT(scene.lost(), 5u) << seed;
    EXPECT_GE(whole.size(), 15u) << seed;
    for (std::size_t i = 1; i < whole.size(); ++i) {
      EXPECT_GT(whole[i], whole[i - 1]) << seed;
      EXPECT_LT(whole[i] - whole[i - 1], std::chrono::seconds(2)) << seed;
    }
    EXPECT_FALSE(whole.empty() || scene.now() - whole.back() > std::chrono::seconds(2)) << seed;
    return whole;
  };
  const auto first = run(1);
  EXPECT_EQ(run(1), first) << "same seed, same run";
  run(2);
}

/// A plan that is given to the root reaches the sensors, through an inner merger, whatever is lost.
TEST(LossyNetwork, APlanForTheRootReachesTheSensors) {
  Scene described = five_a_second();
  described.mergers = {{.id = "inner", .inputs = {"cam-0"}, .deadline_ms = 50},
                       {.id = "root", .inputs = {"inner", "cam-1"}, .deadline_ms = 50}};
  LinkedScene scene(described, {.delay = milliseconds(20), .loss = 0.3, .seed = 4});
  scene.run(std::chrono::seconds(1));
  ASSERT_TRUE(scene.newest());
  EXPECT_EQ(scene.newest()->plan.texture_qp, described.coding.texture_qp);
  codec::Control control;
  control.plan.emplace();
  control.plan->sensors = {{0, 0.03125}, 0.015625, 7, 1, 33};
  control.plan->root = {{0.5, 0}, 0, 3, 0.5, 41};
  for (int i = 0; i < 5; ++i) scene.ask("root", control);  // some of it is lost, too
  scene.run(std::chrono::seconds(5));
  EXPECT_EQ(scene.newest()->plan, control.plan->root);
  for (const auto& [sensor, plan] : scene.sensor_plans())
    EXPECT_EQ(plan, control.plan->sensors) << sensor;
  EXPECT_EQ(scene.sensor_plans().size(), 2u);
}

}  // namespace
}  // namespace mr::runtime
