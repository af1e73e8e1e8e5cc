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

/// A prop of a rig's events and its pose over time since the rig's first frame.
struct ScriptedProp {
  Prop shape;
  std::function<std::optional<Pose>(double time_s)> T_room_prop;  ///< nullopt: absent
  std::function<float(double time_s)> phase;                      ///< of its film; empty: no film
  bool on_floor = true;                                           ///< casts a contact shadow
};

/// A person of an event, who comes in, does something and leaves.
struct ScriptedPerson {
  struct Action {
    double begin_s = 0, end_s = 0;
    std::function<Stance(double share)> stance;  ///< 0 to 1 during the action; room frame
  };

  Body body;
  std::vector<Action> actions;  ///< one after another

  std::optional<Stance> at(double time_s) const;
};

/// The props and people of a rig's events.
struct Script {
  std::vector<ScriptedProp> props;
  std::vector<ScriptedPerson> people;
};

/// Plans the events of a rig. `walks`: paths of walking people, which are kept free.
Script make_script(const RigConfig& rig, double fps, std::span<const Block> blocks,
                   std::span<const Walk> walks);

}  // namespace mr::synth
