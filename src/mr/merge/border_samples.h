#pragma once

#include <cstdint>
#include <vector>

#include "mr/kit/pair_map.h"
#include "mr/merge/border.h"

namespace mr::merge {

/// Points with something that they stand for.
struct TaggedPoints {
  std::vector<Vec3f> points;
  std::vector<std::uint32_t> tag;
};

/// Points along all border edges, at most `spacing` apart, tagged with their place in the border.
TaggedPoints sample_border(const Joined& joined, double spacing);

/// Which parts have border in which cell of a coarse grid, as far as it is one or several: a quick
/// way to pass over borders that lie far from any other part.
class PartsNearby {
 public:
  /// `most_m`: the largest radius that has_other() is asked for.
  PartsNearby(const Joined& joined, const TaggedPoints& samples, float most_m);

  /// Whether a ball may hold samples of a part other than `part`.
  bool has_other(Vec3f middle, std::uint32_t part) const;

 private:
  Vec3i cell(Vec3f p, float shift) const;

  float per_cell_;
  kit::PairMap cells_;  // cell → its part, or that it has several
};

}  // namespace mr::merge
