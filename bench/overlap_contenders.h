#pragma once

#include "merge_case.h"
#include "race.h"

namespace mr::bench {

/// Contenders of overlap removal by the paper's rule. The case must outlive them. The result is one
/// byte per triangle of all parts, 1: removed.

/// farther_triangles() with layered depth images (A-buffer).
Contender overlap_ours(const MergeCase& input, int threads);

/// Embree's scene of all parts and every hit on every ray, as kit::RayScene has them: sorted, both
/// sides of a triangle. Deciding on them is not timed; `with_decisions_ms`: once, with it.
Contender overlap_embree(const MergeCase& input, int threads);

/// The configuration that selects the paper's rule.
merge::OverlapConfig paper_config(const MergeCase& input, merge::MergeConfig::Overlap how);

}  // namespace mr::bench
