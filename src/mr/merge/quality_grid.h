#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "mr/kit/pair_map.h"
#include "mr/merge/measured.h"
#include "mr/merge/part.h"

namespace mr::merge {

/// How well each part measured each place: cos(angle) / sigma, averaged over the triangles around
/// in cells of some voxels, apart for the three axes that a surface may face along. It falls off
/// with the fourth root of the area around, so towards a part's borders, where depth is worst.
/// Being a smooth function of space and not of any one mesh, it divides all meshes along the same
/// lines.
class QualityGrid {
 public:
  /// `parts[i]` was measured as `measured[i]`. Parallel; deterministic.
  QualityGrid(std::span<const Part> parts, std::span<const Measured> measured, double cell_m);

  struct PartQuality {
    std::uint32_t part;
    float quality;
  };

  /// Reads the grid at places that lie near each other.
  class Reader {
   public:
    explicit Reader(const QualityGrid& grid) : grid_(grid) {}

    /// The parts that have surface around a place, by number, as far as it faces along the axes of
    /// `normal`. Valid until the next call.
    std::span<const PartQuality> at(Vec3f place, Vec3f normal);

   private:
    static constexpr std::size_t kCached = 64;
    using Corners = std::array<float, 24>;  // three axes of cell after cell
    /// What the eight cells around a place hold.
    struct Around {
      bool used = false;
      Vec3i cell;
      std::vector<std::uint32_t> parts;
      std::vector<Corners> area, quality;  // [parts]
    };
    const Around& around(Vec3i cell);

    const QualityGrid& grid_;
    std::array<Around, kCached> cache_;
    std::vector<PartQuality> out_;
  };

 private:
  using Sums = std::array<float, 6>;  ///< area, then area · quality, by axis
  struct Entry {
    std::uint32_t part;
    Sums sums;
  };
  struct PartCells;

  float per_cell_;
  kit::PairMap cells_;                // cell → its place in first_
  std::vector<std::uint32_t> first_;  // [cells + 1] into entries_
  std::vector<Entry> entries_;        // by cell, then by part
};

}  // namespace mr::merge
