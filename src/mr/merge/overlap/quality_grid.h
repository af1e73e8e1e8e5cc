#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <mutex>
#include <span>
#include <vector>

#include "mr/kit/pair_map.h"
#include "mr/kit/part.h"
#include "mr/merge/overlap/measured.h"

namespace mr::merge {

/// What a part adds to a cell: area by the axis that it faces along, then area · quality.
using QualitySums = std::array<float, 6>;

/// The cells of one source of a part.
struct QualityCells {
  kit::PairMap places{256};         ///< cell → its place
  std::vector<std::uint64_t> keys;  ///< [cells]
  std::vector<QualitySums> sums;    ///< [cells]
};

/// The grid as it was, by sensor: sums that changed by less than a tenth stay as they were, so that
/// borders between owners lie still while noise does not.
class QualityMemory {
 public:
  /// Steadies the sums of a sensor, and remembers them. Different sensors may come at once.
  void stabilize(std::uint32_t sensor, QualityCells& cells);
  /// While frozen, nothing is remembered: a piece of a scene is merged.
  void freeze(bool frozen) { frozen_ = frozen; }

 private:
  QualityCells& remembered(std::uint32_t sensor);

  bool frozen_ = false;
  std::mutex mutex_;  // for the map alone
  std::map<std::uint32_t, QualityCells> last_;
};

/// How well each part measured each place: cos(angle) / sigma, averaged over the triangles around
/// in cells of some voxels, apart for the three axes that a surface may face along. It falls off
/// with the eighth root of the area around, so towards a part's borders, where depth is worst.
/// Being a smooth function of space and not of any one mesh, it divides all meshes along the same
/// lines.
class QualityGrid {
 public:
  /// `parts[i]` was measured as `measured[i]`. `memory` may be null. Parallel; deterministic.
  QualityGrid(std::span<const kit::Part> parts, std::span<const Measured> measured, double cell_m,
              QualityMemory* memory);

  /// A source of a part: whose surface a spot may be.
  struct Owner {
    std::uint32_t part, source;
  };
  struct Candidate {
    Owner owner;
    std::uint32_t number;  ///< of the owner, part by part and source by source
    float quality;
  };

  /// Reads the grid, best at places that lie near each other in turn.
  class Reader {
   public:
    explicit Reader(const QualityGrid& grid);

    /// Who has surface around a place, as far as it faces along the axes of `normal`; the order
    /// depends on the grid only. Valid until the next call.
    std::span<const Candidate> at(Vec3f place, Vec3f normal);

   private:
    static constexpr std::size_t kCached = 64;
    static constexpr std::size_t kFour = 4;
    /// The sums of four owners in the eight cells around a place, to be added up for all at once.
    struct Four {
      std::array<std::array<float, kFour>, 24> area{}, quality{};  // [3 · cell + axis][owner]
    };
    struct Around {
      Vec3i cell;
      std::vector<std::uint32_t> owners;  // ascending
      std::vector<Four> sums;             // [owners / 4]
    };
    const Around& around(Vec3i cell);
    void gather(Vec3i cell, Around& out);

    const QualityGrid& grid_;
    std::vector<Around> cache_;
    std::vector<std::uint32_t> place_;   // [owners of the grid] in those around, while gathered
    std::vector<float> area_, quality_;  // [owners around, or a few more] at the place
    std::vector<Candidate> out_;
  };

 private:
  struct Entry {
    std::uint32_t owner;
    QualitySums sums;
  };

  float per_cell_;
  std::vector<Owner> owners_;
  kit::PairMap cells_;                // cell → its place in first_
  std::vector<std::uint32_t> first_;  // [cells + 1] into entries_
  std::vector<Entry> entries_;        // by cell, then by owner
};

}  // namespace mr::merge
