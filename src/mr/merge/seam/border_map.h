#pragma once

#include <cstdint>
#include <vector>

#include "mr/kit/pair_map.h"
#include "mr/merge/seam/border.h"

namespace mr::merge {

/// Which parts have border where, in a coarse grid: tells quickly which borders lie so far from
/// those of any other part that there is nothing to close.
class BorderMap {
 public:
  /// `reach_m`: borders of another part this near to an edge are found; some up to three times as
  /// far are, too.
  BorderMap(const Joined& joined, double reach_m);

  /// [border] Whether another part's border may be near an edge, of the mesh as it was or cut
  /// finer. Parallel.
  std::vector<std::uint8_t> has_other_near(const Joined& joined) const;

 private:
  bool has_other_near(const Joined& joined, std::uint32_t half_edge) const;
  template <typename Visit>
  void for_each_cell(const Joined& joined, std::uint32_t half_edge, Visit&& visit) const;

  float per_cell_;
  kit::PairMap place_;                 // cell → its place; two of one key cost a closer look
  std::vector<std::uint8_t> is_near_;  // [cells] several parts have border in or next to it
};

}  // namespace mr::merge
