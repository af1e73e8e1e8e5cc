#include "mr/synth/synthetic_scene.h"

namespace mr::synth {
namespace {

constexpr double kPeriod_s = 10;  // of people's motion, where the rig does not loop

}  // namespace

SyntheticScene::SyntheticScene(const RigConfig& rig, double fps)
    : rig_(rig), fps_(fps), period_s_(rig.loop ? rig.frames / fps : kPeriod_s) {}

void SyntheticScene::build() {
  if (!room_) make();
}

void SyntheticScene::make() {
  room_ = std::make_shared<const Room>(make_room(rig_));
  people_ = std::make_unique<People>(rig_, fps_, period_s_, room_);
}

std::shared_ptr<const Room> SyntheticScene::room() {
  const std::lock_guard lock(mutex_);
  if (!room_) alone_.run([&] { make(); });
  return room_;
}

std::shared_ptr<const PosedPeople> SyntheticScene::people(double time_s) {
  const std::lock_guard lock(mutex_);
  if (!room_) alone_.run([&] { make(); });
  std::shared_ptr<const PosedPeople> posed;
  alone_.run([&] { posed = people_->at(time_s); });
  return posed;
}

}  // namespace mr::synth
