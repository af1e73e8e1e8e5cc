#pragma once

#include "merge_case.h"
#include "race.h"

namespace mr::bench {

/// Parts to the triangles that go by the paper's rule. The case must outlive them; what they return
/// is one byte per triangle of all parts, 1: it goes.

/// farther_triangles() by drawing layered depth images, from meshes to flags.
Contender overlap_ours(const MergeCase& input, int threads);

/// Embree's scene of all parts and every hit on every ray, as kit::RayScene has them: sorted, both
/// sides of a triangle. Deciding on them is not timed; `with_decisions_ms`: once, with it.
Contender overlap_embree(const MergeCase& input, int threads);

/// How the paper's rule is asked for.
merge::OverlapConfig paper_config(const MergeCase& input, merge::MergeConfig::Overlap how);

}  // namespace mr::bench
