#pragma once

#include <optional>

#include "mr/synth/builder.h"
#include "mr/synth/furniture.h"

namespace mr::synth {

/// A door of a room that opens outwards: a hole in its wall with a little vestibule behind.
struct Doorway {
  int wall = 0;  ///< as in at_wall()
  double x = 0;  ///< of its middle, in the wall's frame
  Pose T_room_wall;

  /// A point of the floor before the door; `inwards_m` below 0: behind it, in the vestibule.
  Vec2d before(double inwards_m) const;
  /// The leaf's pose (props.h) where it is open by a share.
  Pose leaf(double open) const;
};

/// The door through which people of a rig's events come; none where no event needs one.
std::optional<Doorway> doorway_of(const RigConfig& rig);

/// Floor, walls and ceiling of the vestibule.
void vestibule(Builder& b, const Doorway& doorway);

}  // namespace mr::synth
