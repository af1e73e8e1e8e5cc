#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mr/synth/doorway.h"
#include "mr/synth/floor_plan.h"
#include "mr/synth/person.h"
#include "mr/synth/props.h"
#include "mr/synth/stance.h"

namespace mr::synth {

/// Something of a rig's events, and where it is at a time since the rig's first frame.
struct ScriptedProp {
  Prop shape;
  std::function<std::optional<Pose>(double time_s)> T_room_prop;  ///< none: it is not there
  std::function<float(double time_s)> phase;  ///< of its film; empty: it has none
  bool on_floor = true;                       ///< it may shade the floor
};

/// Somebody who comes in, does something and leaves.
struct ScriptedPerson {
  struct Action {
    double begin_s = 0, end_s = 0;
    std::function<Stance(double share)> stance;  ///< 0 to 1 during the action; room frame
  };

  Body body;
  std::vector<Action> actions;  ///< one after another

  std::optional<Stance> at(double time_s) const;
};

/// What a rig's events move.
struct Script {
  std::vector<ScriptedProp> props;
  std::vector<ScriptedPerson> people;
};

/// Reads the events of a rig. `walks`: whose ways are kept free.
Script make_script(const RigConfig& rig, double fps, std::span<const Block> blocks,
                   std::span<const Walk> walks);

}  // namespace mr::synth
