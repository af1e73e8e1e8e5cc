#pragma once

#include <string>
#include <string_view>

#include "mr/planner/planner.h"

namespace mr::planner {

/// The `mergers` block of a scene file.
std::string mergers_block(const Plan& plan);

/// A scene file's text with another `mergers` block, at the end where it had none.
std::string with_mergers(std::string_view scene_text, const std::string& block);

}  // namespace mr::planner
