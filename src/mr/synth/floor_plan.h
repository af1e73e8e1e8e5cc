#pragma once

#include <span>
#include <vector>

#include "mr/synth/person.h"
#include "mr/synth/rig_config.h"
#include "mr/synth/room.h"

namespace mr::synth {

/// Clearances and visibility in a room, for planning. Points are in the room frame.
class FloorPlan {
 public:
  FloorPlan(const RigConfig& rig, std::span<const Block> blocks);

  /// Distance to the nearest wall, floor, ceiling or furniture; negative outside the room, 0 inside
  /// an object.
  double clearance_m(Vec3d p) const;
  /// The same for a person standing on the floor; objects low enough to step over do not count.
  double walking_clearance_m(Vec2d p) const;
  /// Line of sight: whether nothing lies between two points.
  bool sees(Vec3d from, Vec3d to) const;

  double half_width_m() const { return half_.x; }
  double half_depth_m() const { return half_.y; }
  double height_m() const { return height_; }

 private:
  Vec2d half_;
  double height_;
  std::vector<Block> blocks_;  // with T_room_object inverted
};

/// Plans elliptic walks through the free part of a room, one per person of the rig; people on the
/// same ellipse follow each other. Fewer if there is no space to walk. T_world_room and period_s
/// are left at their defaults.
std::vector<Walk> plan_walks(const RigConfig& rig, const FloorPlan& plan);

}  // namespace mr::synth
