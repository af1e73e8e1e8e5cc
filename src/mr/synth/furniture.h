#pragma once

#include <vector>

#include "mr/synth/builder.h"
#include "mr/synth/rig_config.h"

namespace mr::synth {

/// A rectangle that shines; all in the room's frame.
struct Light {
  enum class Kind { lamp, window, panel };  ///< a lamp shines to all sides

  Vec3d center;
  Vec3d half_right, half_up;  ///< of the rectangle; windows and panels shine along their cross
  Vec3f power;                ///< of a rectangle: radiance · area; of a lamp: intensity
  Kind kind = Kind::lamp;
};

/// Walls, floor, ceiling, doors and windows, and everything that stands or hangs in the room.
void furnish(Builder& builder, const RigConfig& rig, std::vector<Light>& lights);

/// Where every room stands: turned by 11 degrees about z and 3 about x.
Pose room_pose();

/// A pose turned by `yaw_degrees` about z.
Pose standing(Vec3d place, double yaw_degrees);

/// Frame at the foot of a wall's middle: x right as seen from inside, y into the wall, z up.
/// `wall`: 0 is +y, then clockwise seen from above: +x, -y, -x.
Pose at_wall(const RigConfig& rig, int wall, double right_m = 0);

/// How much smaller than designed the furniture is, so that it fits the room; at most 1.
double furniture_scale(const RigConfig& rig);

}  // namespace mr::synth
