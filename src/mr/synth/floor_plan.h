#pragma once

#include <span>
#include <vector>

#include "mr/synth/person.h"
#include "mr/synth/rig_config.h"
#include "mr/synth/room.h"

namespace mr::synth {

/// What is free in a room. Points are in the room's frame.
class FloorPlan {
 public:
  FloorPlan(const RigConfig& rig, std::span<const Block> blocks);

  /// Distance to the nearest wall, floor, ceiling or furniture; negative outside, 0 inside of
  /// something.
  double clearance_m(Vec3d p) const;
  /// The same for someone upright on the floor; what is flat enough to step over does not count.
  double walking_clearance_m(Vec2d p) const;
  /// Whether nothing stands between two points.
  bool sees(Vec3d from, Vec3d to) const;

  double half_width_m() const { return half_.x; }
  double half_depth_m() const { return half_.y; }
  double height_m() const { return height_; }

 private:
  Vec2d half_;
  double height_;
  std::vector<Block> blocks_;  // with T_room_object inverted
};

/// Rounds through the free part of a room, one per person of the rig: people on the same round
/// follow each other. Fewer where there is no room to walk. T_world_room and period_s stay default.
std::vector<Walk> plan_walks(const RigConfig& rig, const FloorPlan& plan);

}  // namespace mr::synth
