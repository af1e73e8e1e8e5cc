#include "mr/synth/script.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "mr/synth/appearance.h"
#include "mr/synth/floor_path.h"
#include "mr/synth/hash.h"
#include "mr/synth/posed_camera.h"
#include "mr/synth/rig_errors.h"
#include "mr/synth/solid.h"

namespace mr::synth {
namespace {

using Kind = RigEvent::Kind;
using Action = ScriptedPerson::Action;

constexpr double kPace_mps = 1.15;
constexpr double kDoor_s = 1;  // to open or to close
constexpr double kBehindDoor_m = 1.35, kBeforeDoor_m = 0.55;
constexpr double kSitterFeet_m = 0.40;  // ahead of a chair's middle
constexpr double kBoxAhead_m = 0.50;    // of who stoops for it
constexpr std::size_t kMostAsked = 8;   // cameras, for how well a place is seen
constexpr double kHeldAhead_m = 0.37, kHeldHeight_m = 0.92;  // a box in somebody's arms

double heading_of(Vec2d way) { return std::atan2(way.y, way.x); }
Vec2d direction(double heading) { return {std::cos(heading), std::sin(heading)}; }
double distance(Vec2d a, Vec2d b) { return std::hypot(a.x - b.x, a.y - b.y); }
double degrees(double radians) { return radians * 180 / std::numbers::pi; }

/// Acts one after another, from time 0; moved to their place in time at the end.
class ActionSequence {
 public:
  explicit ActionSequence(const Skeleton& skeleton) : skeleton_(skeleton) {}

  double now_s() const { return actions_.empty() ? 0 : actions_.back().end_s; }
  const Stance& last() const { return last_; }

  void begin_at(Stance stance) { last_ = std::move(stance); }

  void hold(double seconds) {
    add(seconds, [stance = last_](double) { return stance; });
  }

  /// On to another stance; `early` and `late`: slow at the beginning, at the end.
  void go_to(Stance stance, double seconds, bool early = true, bool late = true) {
    add(seconds, [from = last_, to = stance, early, late](double share) {
      const double eased = early && late ? smooth_step(0, 1, share)
                           : early       ? share * share
                           : late        ? share * (2 - share)
                                         : share;
      return blended(from, to, eased);
    });
    last_ = std::move(stance);
  }

  /// On the spot, in steps of at most 60 degrees. `keep_arms`: as they are.
  void turn_to(FloorPose spot, double heading, bool keep_arms = false) {
    const double turn = std::remainder(heading - spot.heading_rad, 2 * std::numbers::pi);
    const int steps = static_cast<int>(std::ceil(std::abs(turn) / 1.05));
    const auto arms = last_.arms;
    for (int i = 1; i <= steps; ++i) {
      Stance stance = standing_stance(
          skeleton_, {spot.place, spot.heading_rad + turn * i / std::max(steps, 1)});
      if (keep_arms) stance.arms = arms;
      go_to(std::move(stance), 0.45, i == 1, i == steps);
    }
  }

  void walk(std::shared_ptr<const FloorPath> path, std::uint64_t seed, bool keep_arms = false) {
    const auto stance = [skeleton = skeleton_, path, seed, keep_arms,
                         arms = last_.arms](double part) {
      Stance out = walking_stance(skeleton, *path, part, seed);
      if (keep_arms) out.arms = arms;
      return out;
    };
    go_to(stance(0), 0.4, true, false);
    add(path->length_m() / kPace_mps, stance);
    last_ = stance(1);
  }

  /// The actions such that `now` of the sequence becomes `time_s`.
  std::vector<Action> timed(double now, double time_s) const {
    std::vector<Action> out = actions_;
    for (Action& action : out) action.begin_s += time_s - now, action.end_s += time_s - now;
    return out;
  }

 private:
  void add(double seconds, std::function<Stance(double)> stance) {
    actions_.push_back({now_s(), now_s() + seconds, std::move(stance)});
  }

  const Skeleton& skeleton_;
  std::vector<Action> actions_;
  Stance last_;
};

/// Somebody in trousers: a skirt does not sit down well.
Body body_of(std::uint64_t seed) {
  while (make_appearance(seed).bottom == Bottom::skirt || make_appearance(seed).top == Top::coat)
    seed = mix(seed);
  return make_body(seed);
}

class ScriptBuilder {
 public:
  ScriptBuilder(const RigConfig& rig, double fps, std::span<const Block> blocks,
                std::span<const Walk> walks)
      : rig_(rig),
        fps_(fps),
        blocks_(blocks),
        plan_(rig, blocks),
        walks_(walks),
        doorway_(doorway_of(rig)) {
    for (const SensorConfig& sensor : exact_sensors(rig)) {
      cameras_.push_back({sensor.depth_camera, room_pose().inverse() * sensor.T_world_depth.at(0)});
      if (cameras_.size() == kMostAsked) break;
    }
    for (std::size_t i = 0; i < rig.events.size(); ++i) places_.push_back(place_of(rig.events[i]));
  }

  Script direct() {
    for (std::size_t i = 0; i < rig_.events.size(); ++i) {
      event_ = &rig_.events[i], place_ = places_[i], seed_ = mix(rig_.seed, 9000 + i);
      switch (event_->kind) {
        case Kind::sit:
          sit();
          break;
        case Kind::chair:
          move_chair();
          break;
        case Kind::door:
          open_door(begin_s(), end_s());
          break;
        case Kind::carry:
          carry();
          break;
        case Kind::vanish:
          vanish();
          break;
        case Kind::screen:
          play();
          break;
        case Kind::light:
        case Kind::push:
        case Kind::dropout:
        case Kind::exposure:
        case Kind::hunt:
          break;  // of the pictures: sensor_effects.h
      }
    }
    if (doorway_) add_door();
    return std::move(script_);
  }

 private:
  double begin_s() const { return event_->at / fps_; }
  double end_s() const { return (event_->at + event_->frames) / fps_; }

  // --- places

  static bool needs_place(const RigEvent& event) {
    return event.kind == Kind::sit || event.kind == Kind::chair || event.kind == Kind::carry ||
           event.kind == Kind::vanish || event.kind == Kind::screen;
  }

  double from_walkers(Vec2d p) const {
    constexpr int kSamples = 32;
    double least = 1e9;
    for (const Walk& walk : walks_)
      for (int i = 0; i < kSamples; ++i) {
        const Vec2d way = direction(2 * std::numbers::pi * i / kSamples);
        least = std::min(
            least, distance(p, walk.center + Vec2d{walk.radius.x * way.x, walk.radius.y * way.y}));
      }
    return least;
  }

  /// By how many cameras something on the floor is well seen.
  int seen_by(Vec2d place) const {
    constexpr double kNear_m = 1.5, kFar_m = 4.5;
    int sum = 0;
    for (const PosedCamera& eye : cameras_) {
      const Vec3d from = eye.T_world_camera.translation;
      const double far = distance(place, {from.x, from.y});
      bool sees = far > kNear_m && far < kFar_m;
      for (const double height : {0.15, 0.6, 1.1}) {
        const Vec3d target{place.x, place.y, height};
        const auto at = project(eye.camera, eye.T_world_camera.inverse() * target);
        sees = sees && at && at->x > 0 && at->y > 0 && at->x < eye.camera.width &&
               at->y < eye.camera.height && plan_.sees(from, target);
      }
      sum += sees;
    }
    return sum;
  }

  /// The event's, else where most room is: off walkers, other events and the door, and well seen.
  Vec2d place_of(const RigEvent& event) const {
    constexpr double kStep_m = 0.1, kEnough_m = 0.75, kWall_m = 0.6;
    if (!needs_place(event)) return {};
    if (event.place_m) return *event.place_m;
    Vec2d best;
    double most = -1e9;
    const double w = plan_.half_width_m() - kWall_m, d = plan_.half_depth_m() - kWall_m;
    for (double y = -d; y <= d; y += kStep_m)
      for (double x = -w; x <= w; x += kStep_m) {
        const Vec2d p{x, y};
        double room = std::min(plan_.walking_clearance_m(p), from_walkers(p) - 0.15);
        for (std::size_t i = 0; i < places_.size(); ++i)
          if (needs_place(rig_.events[i])) room = std::min(room, distance(p, places_[i]) - 0.5);
        if (doorway_) room = std::min(room, distance(p, doorway_->before(0)) - 0.8);
        double score = std::min(room, kEnough_m) - 0.05 * std::hypot(x, y);
        if (score + 0.3 <= most) continue;
        score += 0.15 * std::min(seen_by(p), 2);
        if (score > most) most = score, best = p;
      }
    return best;
  }

  /// Where one can go straight on for `far_m` with most room: a heading.
  double free_heading(Vec2d from, double far_m) const {
    constexpr int kWays = 24, kSamples = 8;
    double best = 0, most = -1e9;
    for (int i = 0; i < kWays; ++i) {
      const double heading = 2 * std::numbers::pi * i / kWays;
      double room = 1;
      for (int k = 1; k <= kSamples; ++k)
        room = std::min(
            room, plan_.walking_clearance_m(from + direction(heading) * (far_m * k / kSamples)));
      if (room > most) most = room, best = heading;
    }
    return best;
  }

  // --- coming and going

  /// Around what events put there, but for what lies under the way's end.
  FloorPath way_in(Vec2d to) const {
    std::vector<Block> blocks(blocks_.begin(), blocks_.end());
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const Vec2d p = places_[i];
      const double half = rig_.events[i].kind == Kind::screen ? 0.3 : 0.2;
      if (needs_place(rig_.events[i]) && distance(p, to) > half)
        blocks.push_back({standing({p.x, p.y, 0}, 0), {-half, -half, 0}, {half, half, 1}});
    }
    return {FloorPlan(rig_, blocks), doorway_->before(-kBehindDoor_m),
            doorway_->before(kBeforeDoor_m), to};
  }

  /// In through the door; ends standing at the way's end. The choreography begins with it.
  void come_in(ActionSequence& actions, const Skeleton& skeleton, const FloorPath& path) const {
    actions.begin_at(standing_stance(skeleton, path.at(0)));
    actions.hold(kDoor_s);
    actions.walk(std::make_shared<const FloorPath>(path), seed_);
    actions.go_to(standing_stance(skeleton, path.at(1)), 0.5, false, true);
  }

  /// Out through the door from where the stance of last() faces the way.
  void go_out(ActionSequence& actions, const FloorPath& path, bool keep_arms = false) const {
    actions.walk(std::make_shared<const FloorPath>(path), mix(seed_), keep_arms);
    actions.hold(kDoor_s);
  }

  /// Somebody's whole performance; the door opens for them.
  void perform(Body body, std::vector<Action> actions) {
    const double through_s = kDoor_s + 0.4 + (kBehindDoor_m + kBeforeDoor_m) / kPace_mps;
    open_door(actions.front().begin_s, actions.front().begin_s + through_s);
    open_door(actions.back().end_s - through_s - kDoor_s, actions.back().end_s - kDoor_s);
    script_.people.push_back({std::move(body), std::move(actions)});
  }

  void open_door(double begin_s, double end_s) { open_s_.push_back({begin_s, end_s}); }

  void add_door() {
    script_.props.push_back({door_leaf_prop(),
                             [doorway = *doorway_, open_s = open_s_](double t) {
                               double open = 0;
                               for (const Vec2d& times : open_s)
                                 open =
                                     std::max(open, smooth_step(times.x, times.x + kDoor_s, t) -
                                                        smooth_step(times.y, times.y + kDoor_s, t));
                               return std::optional(doorway.leaf(open));
                             },
                             {},
                             false});
  }

  // --- events

  void sit() {
    Body body = body_of(seed_);
    const Skeleton skeleton = body.skeleton;
    // The chair stands across the way in, so that who comes turns by about 90 degrees.
    const double arrival = way_in(place_).at(1).heading_rad;
    const Vec2d across{-std::sin(arrival), std::cos(arrival)};
    const bool to_middle = across.x * place_.x + across.y * place_.y < 0;
    const double facing = heading_of(to_middle ? across : across * -1);
    const Pose chair = standing({place_.x, place_.y, 0}, degrees(facing) + 90);
    script_.props.push_back(
        {chair_prop(0xC2703D), [chair](double) { return std::optional(chair); }, {}});

    const FloorPath path = way_in(place_ + direction(facing) * kSitterFeet_m);
    const FloorPose before{path.at(1).place, facing}, seat{place_, facing};
    const Stance upright = seated_stance(skeleton, seat, kSeat_m, kSitterFeet_m, 0),
                 leaning = seated_stance(skeleton, seat, kSeat_m, kSitterFeet_m, 0.28);
    const Stance stand = standing_stance(skeleton, before);
    const Stance crouch = crouching_stance(skeleton, stand, upright);
    ActionSequence actions(skeleton);
    come_in(actions, skeleton, path);
    actions.turn_to(path.at(1), facing);
    actions.go_to(crouch, 0.6, true, false);
    actions.go_to(upright, 0.7, false, true);
    actions.go_to(leaning, 0.8);
    const double seated_s = actions.now_s();
    actions.hold(event_->frames / fps_);
    actions.go_to(upright, 0.7);
    actions.go_to(crouch, 0.6, true, false);
    actions.go_to(stand, 0.7, false, true);
    const FloorPath out = path.reversed();
    actions.turn_to(before, out.at(0).heading_rad);
    go_out(actions, out);
    perform(std::move(body), actions.timed(seated_s, begin_s()));
  }

  void move_chair() {
    const double heading = free_heading(place_, event_->by_m);
    const Vec2d from = place_, to = place_ + direction(heading) * event_->by_m;
    const double yaw = 40 * unit(mix(seed_, 1)) + degrees(heading), begin = begin_s(),
                 end = end_s();
    script_.props.push_back({chair_prop(0x2F6F73),
                             [=](double t) {
                               const double share = smooth_step(begin, end, t);
                               const Vec2d p = from * (1 - share) + to * share;
                               return std::optional(standing({p.x, p.y, 0}, yaw + 35 * share));
                             },
                             {}});
  }

  void play() {
    const double yaw = degrees(heading_of(place_)) - 90;  // its back to the nearest wall, about
    const Pose T = standing({place_.x, place_.y, 0}, yaw);
    const double begin = begin_s(), end = end_s(), fps = fps_;
    script_.props.push_back({screen_prop(), [T](double) { return std::optional(T); },
                             [=](double t) {
                               return static_cast<float>(0.037 * fps *
                                                         (std::clamp(t, begin, end) - begin));
                             }});
  }

  void carry() {
    Body body = body_of(seed_);
    const Skeleton skeleton = body.skeleton;
    const double arrival = way_in(place_).at(1).heading_rad;
    const FloorPath path = way_in(place_ - direction(arrival) * kBoxAhead_m);
    const FloorPose before = path.at(1);
    const Vec2d box = before.place + direction(before.heading_rad) * kBoxAhead_m;
    const Stance reaching = reaching_stance(skeleton, before);
    Stance holding = standing_stance(skeleton, before);
    holding.arms = holding_arms();
    const double lift_s = 0.9;
    ActionSequence actions(skeleton);
    come_in(actions, skeleton, path);
    actions.go_to(reaching, 0.9);
    const double reached_s = actions.now_s();
    actions.go_to(holding, lift_s);
    const FloorPath out = path.reversed();
    actions.turn_to(before, out.at(0).heading_rad, true);
    go_out(actions, out, true);
    ScriptedPerson who{{}, actions.timed(reached_s, begin_s())};
    const Pose on_floor = standing({box.x, box.y, 0}, degrees(before.heading_rad));
    script_.props.push_back({box_prop(),
                             [who, on_floor, begin = begin_s(), lift_s](double t) {
                               return box_at(who, on_floor, begin, lift_s, t);
                             },
                             {}});
    perform(std::move(body), std::move(who.actions));
  }

  /// A box that somebody lifts from `begin_s` on.
  static std::optional<Pose> box_at(const ScriptedPerson& who, const Pose& on_floor, double begin_s,
                                    double lift_s, double time_s) {
    if (time_s < begin_s) return on_floor;
    const auto stance = who.at(time_s);
    if (!stance) return std::nullopt;
    const Vec3d ahead = stance->pelvis_attitude * kAhead;
    const double heading = std::atan2(ahead.y, ahead.x);
    const Vec2d held =
        Vec2d{stance->pelvis_place.x, stance->pelvis_place.y} + direction(heading) * kHeldAhead_m;
    const double share = smooth_step(0, 1, (time_s - begin_s) / lift_s);
    const Vec3d p =
        on_floor.translation * (1 - share) + Vec3d{held.x, held.y, kHeldHeight_m} * share;
    return standing(p, degrees(heading));
  }

  void vanish() {
    const Pose T = standing({place_.x, place_.y, 0}, 20);
    script_.props.push_back(
        {box_prop(),
         [T, begin = begin_s()](double t) { return t < begin ? std::optional(T) : std::nullopt; },
         {}});
    if (!event_->sensor.empty()) stand_in_the_way();
  }

  /// Somebody stands between a sensor and the event's place while it is under way, and a second
  /// before.
  void stand_in_the_way() {
    const std::vector<std::string> ids = rig_.sensor_ids();
    const auto sensor = std::find(ids.begin(), ids.end(), event_->sensor) - ids.begin();
    const Vec3d eye =
        room_pose().inverse() * exact_sensors(rig_).at(sensor).T_world_depth.at(0).translation;
    const Vec2d from{eye.x, eye.y};
    const double far = distance(from, place_);
    const Vec2d to_eye = (from - place_) * (1 / std::max(far, 1e-6));
    Vec2d place = place_ + to_eye * 0.6;  // where there is most room to stand
    for (double off = 0.65; off < std::min(0.6 * far, 1.3); off += 0.05)
      if (const Vec2d p = place_ + to_eye * off;
          plan_.walking_clearance_m(p) > plan_.walking_clearance_m(place) + 0.02)
        place = p;
    Body body = body_of(seed_);
    const FloorPath path = way_in(place);
    const FloorPose spot = path.at(1);
    ActionSequence actions(body.skeleton);
    come_in(actions, body.skeleton, path);
    actions.turn_to(spot, heading_of(to_eye * -1));
    actions.hold(1);
    const double gone_s = actions.now_s();
    actions.hold(event_->frames / fps_);
    const FloorPath out = path.reversed();
    actions.turn_to({spot.place, heading_of(to_eye * -1)}, out.at(0).heading_rad);
    go_out(actions, out);
    perform(std::move(body), actions.timed(gone_s, begin_s()));
  }

  const RigConfig& rig_;
  const double fps_;
  const std::span<const Block> blocks_;
  const FloorPlan plan_;
  const std::span<const Walk> walks_;
  const std::optional<Doorway> doorway_;
  std::vector<PosedCamera> cameras_;  // room frame; the first ones
  std::vector<Vec2d> places_;         // [events]
  std::vector<Vec2d> open_s_;         // the door: begins to open, to close
  Script script_;
  // The event under way:
  const RigEvent* event_ = nullptr;
  Vec2d place_;
  std::uint64_t seed_ = 0;
};

}  // namespace

std::optional<Stance> ScriptedPerson::at(double time_s) const {
  for (const Action& action : actions)
    if (time_s >= action.begin_s && time_s < action.end_s)
      return action.stance((time_s - action.begin_s) / (action.end_s - action.begin_s));
  return std::nullopt;
}

Script make_script(const RigConfig& rig, double fps, std::span<const Block> blocks,
                   std::span<const Walk> walks) {
  return ScriptBuilder(rig, fps, blocks, walks).direct();
}

}  // namespace mr::synth
