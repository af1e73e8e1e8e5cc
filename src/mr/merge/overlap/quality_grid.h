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

/// A part's contribution to a cell: area, split among the three axes by
/// the squares of the normal's components; then area · quality likewise.
using QualitySums = std::array<float, 6>;

/// The hash grid of one source of a part.
struct QualityCells {
  kit::PairMap places{256};         ///< cell → index
  std::vector<std::uint64_t> keys;  ///< [cells]
  std::vector<QualitySums> sums;    ///< [cells]
};

/// Hysteresis for the quality grid over time, by sensor: sums that change by less than a tenth keep
/// their old value, so that noise does not move borders between owners.
class QualityMemory {
 public:
  /// Applies the hysteresis to a sensor's sums. Different sensors may be processed at once.
  void stabilize(SensorId sensor, QualityCells& cells) const;
  /// Remembers a sensor's sums, stabilized ones of the whole scene. Different sensors may be
  /// processed at once.
  void learn(SensorId sensor, const QualityCells& cells);

 private:
  mutable std::mutex mutex_;  // for the map alone
  std::map<SensorId, QualityCells> last_;
};

/// The quality of each part's measurement as a function of space: cos(angle) / sigma, averaged over
/// triangles in a hash grid with cells of some voxels, separately for the three axes that a surface
/// may face along, and interpolated trilinearly. It is multiplied by the eighth root of the area
/// around, so it decreases towards a part's borders, where depth is worst. As it is smooth and does
/// not depend on any one mesh, it divides all meshes along the same lines.
class QualityGrid {
 public:
  /// `parts[i]` was measured as `measured[i]`. `memory` may be null, and `learns` where the parts
  /// are the whole scene. Parallel; deterministic.
  QualityGrid(std::span<const kit::Part> parts, std::span<const Measured> measured, double cell_m,
              QualityMemory* memory, bool learns);

  /// A possible owner of surface: a source of a part.
  struct Owner {
    std::uint32_t part, source;
  };
  struct Candidate {
    Owner owner;
    std::uint32_t number;  ///< of the owner, part by part and source by source
    float quality;
  };

  /// Queries the grid; fastest when successive points are near each other (it caches cells).
  class Reader {
   public:
    explicit Reader(const QualityGrid& grid);

    /// The owners of surface around a point that faces along the axes of `normal`, in an order that
    /// depends on the grid only. Valid until the next call.
    std::span<const Candidate> at(Vec3f place, Vec3f normal);

   private:
    static constexpr std::size_t kCached = 64;
    static constexpr std::size_t kFour = 4;
    /// The sums of four owners in the eight cells around a point, for SIMD.
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
