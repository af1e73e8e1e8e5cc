#include "mr/synth/floor_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "mr/synth/hash.h"

namespace mr::synth {
namespace {

constexpr double kStepOver_m = 0.06;  // rugs and the like
constexpr double kTall_m = 1.95;      // what hangs higher is no obstacle
constexpr double kElbow_m = 0.34;     // least distance of a walker's middle to furniture
constexpr double kBestElbow_m = 0.5;  // more is of no use
constexpr double kApart_m = 0.8;      // between two rounds
constexpr int kSamples = 48;

/// How far walkers are from furniture, on a grid: a room is searched for rounds thousands of times.
class ClearanceMap {
 public:
  explicit ClearanceMap(const FloorPlan& plan)
      : low_{-plan.half_width_m(), -plan.half_depth_m()},
        columns_(static_cast<int>(2 * plan.half_width_m() / kCell_m) + 2),
        rows_(static_cast<int>(2 * plan.half_depth_m() / kCell_m) + 2) {
    for (int y = 0; y < rows_; ++y)
      for (int x = 0; x < columns_; ++x)
        values_.push_back(plan.walking_clearance_m({low_.x + x * kCell_m, low_.y + y * kCell_m}));
  }

  /// Between the grid's points; `p` lies in the room.
  double at(Vec2d p) const {
    const double x = (p.x - low_.x) / kCell_m, y = (p.y - low_.y) / kCell_m;
    const int i = std::clamp(static_cast<int>(x), 0, columns_ - 2);
    const int j = std::clamp(static_cast<int>(y), 0, rows_ - 2);
    const double* v = values_.data() + j * columns_ + i;
    const double fx = x - i, fy = y - j;
    return (v[0] * (1 - fx) + v[1] * fx) * (1 - fy) +
           (v[columns_] * (1 - fx) + v[columns_ + 1] * fx) * fy;
  }

 private:
  static constexpr double kCell_m = 0.1;

  Vec2d low_;
  int columns_, rows_;
  std::vector<double> values_;  // [rows * columns]
};

struct WalkEllipse {
  Vec2d center, radius;
  double score = 0;
};

Vec2d on(const WalkEllipse& round, int sample) {
  const double a = 2 * std::numbers::pi * sample / kSamples;
  return {round.center.x + round.radius.x * std::cos(a),
          round.center.y + round.radius.y * std::sin(a)};
}

/// Long rounds with free elbows are good; 0 where somebody would bump into something.
double score(const WalkEllipse& round, const ClearanceMap& map,
             std::span<const WalkEllipse> taken) {
  double narrowest = kBestElbow_m;
  for (int i = 0; i < kSamples; ++i) {
    const Vec2d p = on(round, i);
    narrowest = std::min(narrowest, map.at(p));
    if (narrowest < kElbow_m) return 0;
    for (const WalkEllipse& other : taken)
      for (int j = 0; j < kSamples; j += 2) {
        const Vec2d q = on(other, j);
        if (std::hypot(p.x - q.x, p.y - q.y) < kApart_m) return 0;
      }
  }
  const double length = std::numbers::pi * (round.radius.x + round.radius.y);
  return std::min(length, 9.0) * narrowest;  // in 10 s nobody runs
}

/// The best round of a grid of centres and radii.
std::optional<WalkEllipse> best_round(const FloorPlan& plan, const ClearanceMap& map,
                                      std::span<const WalkEllipse> taken) {
  constexpr double kStep = 0.2;
  WalkEllipse best;
  const double w = plan.half_width_m(), d = plan.half_depth_m();
  const auto steps = [&](double half) { return static_cast<int>(half / kStep); };
  for (int iy = -steps(d); iy <= steps(d); ++iy)
    for (int ix = -steps(w); ix <= steps(w); ++ix)
      for (double ry = 0.3; ry < std::min(d, 2.6); ry += kStep)
        for (double rx = 0.3; rx < std::min(w, 2.6); rx += kStep) {
          WalkEllipse round{{ix * kStep, iy * kStep}, {rx, ry}};
          if (std::abs(round.center.x) + rx > w - kElbow_m ||
              std::abs(round.center.y) + ry > d - kElbow_m)
            continue;
          if (std::min(std::numbers::pi * (rx + ry), 9.0) * kBestElbow_m <= best.score) continue;
          round.score = score(round, map, taken);
          if (round.score > best.score) best = round;
        }
  return best.score > 0 ? std::optional(best) : std::nullopt;
}

Vec3d outside_by(const Block& block, Vec3d p) {
  const auto axis = [](double v, double low, double high) {
    return std::max({low - v, v - high, 0.0});
  };
  return {axis(p.x, block.low.x, block.high.x), axis(p.y, block.low.y, block.high.y),
          axis(p.z, block.low.z, block.high.z)};
}

}  // namespace

FloorPlan::FloorPlan(const RigConfig& rig, std::span<const Block> blocks)
    : half_{rig.room_m.x / 2, rig.room_m.y / 2},
      height_(rig.room_m.z),
      blocks_(blocks.begin(), blocks.end()) {
  for (Block& block : blocks_) block.T_room_object = block.T_room_object.inverse();
}

double FloorPlan::clearance_m(Vec3d p) const {
  double best = std::min({half_.x - std::abs(p.x), half_.y - std::abs(p.y), p.z, height_ - p.z});
  for (const Block& block : blocks_)
    best = std::min(best, length(outside_by(block, block.T_room_object * p)));
  return best;
}

double FloorPlan::walking_clearance_m(Vec2d p) const {
  double best = std::min(half_.x - std::abs(p.x), half_.y - std::abs(p.y));
  for (const Block& block : blocks_) {
    const Vec3d q = block.T_room_object * Vec3d{p.x, p.y, 0};  // objects stand upright
    if (block.high.z - q.z < kStepOver_m || block.low.z - q.z > kTall_m) continue;
    const Vec3d off = outside_by(block, q);
    best = std::min(best, std::hypot(off.x, off.y));
  }
  return best;
}

bool FloorPlan::sees(Vec3d from, Vec3d to) const {
  constexpr int kSteps = 12;
  constexpr double kFree_m = 0.05;
  for (int i = 1; i < kSteps; ++i)
    if (clearance_m(from + (to - from) * (static_cast<double>(i) / kSteps)) < kFree_m) return false;
  return true;
}

std::vector<Walk> plan_walks(const RigConfig& rig, const FloorPlan& plan) {
  constexpr double kPerPerson_m = 1.6;
  std::vector<WalkEllipse> rounds;
  std::vector<int> most;  // people that a round has place for
  int places = 0;
  const ClearanceMap map(plan);
  while (places < rig.people) {
    const auto round = best_round(plan, map, rounds);
    if (!round) break;
    rounds.push_back(*round);
    const double length = std::numbers::pi * (round->radius.x + round->radius.y);
    most.push_back(std::max(1, static_cast<int>(length / kPerPerson_m)));
    places += most.back();
  }
  std::vector<Walk> walks;
  for (std::size_t r = 0; r < rounds.size(); ++r) {
    const int wanted = rig.people - static_cast<int>(walks.size());
    const int here = std::min(wanted, most[r]);
    const double turn = unit(mix(rig.seed, 7000 + r));
    for (int i = 0; i < here; ++i) {
      Walk walk;
      walk.center = rounds[r].center, walk.radius = rounds[r].radius;
      walk.start_turns = turn + static_cast<double>(i) / here;
      walk.start_turns -= std::floor(walk.start_turns);
      walk.clockwise = r % 2 == 1;
      walk.seed = mix(rig.seed, 6000 + walks.size());
      walks.push_back(walk);
    }
  }
  return walks;
}

}  // namespace mr::synth
