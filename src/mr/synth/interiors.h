#pragma once

#include <vector>

#include "mr/synth/builder.h"
#include "mr/synth/furniture.h"
#include "mr/synth/rig_config.h"

/// One function per kind of room: walls, floor, ceiling, lights and everything inside.
namespace mr::synth {

void living_room(Builder& b, const RigConfig& rig, std::vector<Light>& lights);
/// A long table with chairs, a screen and a whiteboard.
void conference_room(Builder& b, const RigConfig& rig, std::vector<Light>& lights);
/// Desks with monitors along two walls, shelves, plants; the middle is free.
void office(Builder& b, const RigConfig& rig, std::vector<Light>& lights);
/// Doors with signs on both long sides.
void corridor(Builder& b, const RigConfig& rig, std::vector<Light>& lights);
/// An entrance: coats, bench, stairs, columns, notice board.
void hallway(Builder& b, const RigConfig& rig, std::vector<Light>& lights);

}  // namespace mr::synth
