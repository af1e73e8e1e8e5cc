#pragma once

#include <string>

#include "mr/yaml/tree.h"

namespace mr::yaml {

/// Sets one value of a tree by an option such as "merge.simplify.ratio=0.5". The value is YAML. An
/// item of a list is named by its id or its number, from 0: "sensors.cam-0.depth_range_m=[0.3, 4]".
/// A missing key is added. The new nodes get the line number `line`. Returns "", or the problem of
/// the option, which then has no effect.
std::string set_value(Node& root, const std::string& option, int line);

}  // namespace mr::yaml
