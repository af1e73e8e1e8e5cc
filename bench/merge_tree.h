#pragma once

#include "merge_case.h"
#include "race.h"

namespace mr::bench {

/// What a tree of mergers did, each measured alone, one after another.
struct TreeOutcome {
  Outcome whole;  ///< ms: the slowest of a layer and the root, as if a layer ran at once; peak_mb:
                  ///< the largest merger's; the result is the root's
  double slowest_ms = 0, root_ms = 0, sum_ms = 0;  ///< slowest: of those below the root; medians
  double largest_mb = 0;                           ///< peak_mb and input of the largest merger
};

/// A merger per group of the case's parts, and a root over what they made.
TreeOutcome measure_tree(const MergeCase& input, int threads, const RaceConfig& config,
                         const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace mr::bench
