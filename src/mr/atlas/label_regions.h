#pragma once

#include <cstdint>
#include <optional>
#include <queue>
#include <vector>

#include "mr/atlas/label_problem.h"

namespace mr::atlas {

/// The regions of a labelling: connected triangles of one label. Moves whole regions to the label
/// of a neighbour, which they then belong to.
class LabelRegions {
 public:
  /// `label` is changed in place. Both must outlive this.
  LabelRegions(const LabelProblem& problem, std::vector<int>& label);

  /// Moves regions, the smallest first, while that makes the energy less. Whether any moved.
  bool improve();
  /// Moves regions of a smaller area to the label of a neighbour that adds least energy: as a
  /// whole, else triangle by triangle if that leaves nothing of them. Whether any moved.
  bool remove_below(double area_m2);

 private:
  struct Region {
    std::vector<std::uint32_t> triangles;  ///< of small ones that may move; of others, some
    std::size_t count = 0;                 ///< of all its triangles
    double area_m2 = 0;
    bool may_move = true;
  };
  struct Move {
    int label;
    double energy;  ///< added
  };
  /// The smallest first; ties by number. An entry with an old area is skipped.
  using Entry = std::pair<double, std::uint32_t>;

  bool move_regions(double largest_m2, bool always);
  std::optional<Move> best_move(const Region& region);
  void add_border(const Region& region);
  std::uint32_t move(std::uint32_t r, int label);
  std::uint32_t region_of(std::uint32_t t);
  std::uint32_t best_neighbour(std::uint32_t t) const;
  bool dissolve(std::uint32_t r);
  void find_regions();

  const LabelProblem& problem_;
  std::vector<int>& label_;
  std::vector<std::uint32_t> of_triangle_;  ///< [T] number of a region that was joined with others
  std::vector<std::uint32_t> joined_to_;    ///< [regions] another one; itself: it is none
  std::vector<Region> regions_;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue_;
  std::vector<double> added_;            ///< [views] scratch of best_move
  std::vector<std::uint8_t> is_beside_;  ///< [views] the same
};

}  // namespace mr::atlas
