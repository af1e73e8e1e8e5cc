#pragma once

#include <span>

#include "mr/core/mesh.h"

namespace mr::merge {

/// Removes what overlap removal leaves of one surface over another, where sensors disagree by more
/// than is expected; the zipper would join both as a second layer. A triangle goes if, along its
/// normal and within `near_m`, a component with more area has surface that faces alike, so that all
/// that was covered stays covered. As the redundant triangles of Turk and Levoy 1994 (section 4.1),
/// but not from the border on. Parallel; deterministic.
void remove_second_layers(std::span<Mesh> parts, double near_m);

}  // namespace mr::merge
