#pragma once

#include <cstdint>
#include <vector>

#include "mr/kit/pair_map.h"
#include "mr/merge/seam/border.h"

namespace mr::merge {

/// A coarse hash grid of which parts have borders where, to skip borders that are far from those of
/// any other part.
class BorderMap {
 public:
  /// `reach_m`: borders of another part within this distance of an edge are found; conservative:
  /// some up to three times as far are, too.
  BorderMap(const Joined& joined, double reach_m);

  /// [border] whether another part's border may be near an edge, of the original mesh or one with
  /// split edges. Parallel.
  std::vector<std::uint8_t> has_other_near(const Joined& joined) const;

 private:
  bool has_other_near(const Joined& joined, std::uint32_t half_edge) const;
  template <typename Visit>
  void for_each_cell(const Joined& joined, std::uint32_t half_edge, Visit&& visit) const;

  float per_cell_;
  kit::PairMap place_;                 // cell → index; a collision of keys only costs time
  std::vector<std::uint8_t> is_near_;  // [cells] several parts have border in or next to it
};

}  // namespace mr::merge
