#pragma once

#include <string>

#include "mr/yaml/tree.h"

namespace mr::yaml {

/// Sets one value of a tree, as "merge.simplify.ratio=0.5" says. The value is YAML. An item of a
/// list is named by its id or its number, from 0: "sensors.cam-0.depth_range_m=[0.3, 4]". A key
/// that is not there is added. What is set stands in `line`. Returns what is wrong with the option,
/// which then changed nothing; else "".
std::string set_value(Node& root, const std::string& option, int line);

}  // namespace mr::yaml
