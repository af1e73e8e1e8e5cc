#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/kit/part.h"
#include "mr/merge/overlap/cutter.h"
#include "mr/merge/overlap/measured.h"
#include "mr/merge/overlap/overlap.h"
#include "mr/merge/overlap/part_view.h"
#include "mr/merge/overlap/quality_grid.h"
#include "mr/merge/overlap/ray_grids.h"

namespace mr::merge {

/// Where a part lost a point of its surface.
struct Loss {
  static constexpr std::uint32_t kNoOwner = 0xFFFFFFFFu;
  std::uint32_t owner = kNoOwner;  ///< its number, as QualityGrid::Candidate has it
  bool is_clear = false;           ///< it measured the point better by far
};

/// A part's quality at one of its points minus the best quality of another part with surface there
/// (positive: the part measured it best), and that other part.
struct OwnershipMargin {
  float margin = 0;
  Loss loss;
};

/// Which part measured a point of the surface best, of those that have surface there; and which
/// parts keep it, as far as they have said so.
class OwnershipMap {
 public:
  /// `memory` may be null. The parts must outlive the map. Parallel.
  OwnershipMap(std::span<const kit::Part> parts, const OverlapConfig& config,
               QualityMemory* memory);

  const Mesh& mesh(std::size_t part) const { return parts_[part].mesh; }
  const std::vector<SurfacePoint>& vertices(std::size_t part) const {
    return measured_[part].vertices;
  }
  /// The sensor that measured a triangle of a part.
  SensorId sensor(std::size_t part, std::uint32_t triangle) const {
    return parts_[part].sources[measured_[part].source[triangle]].sensor;
  }

  /// Says that a part keeps a region, or keeps it besides what it said before. Different parts may
  /// do so at once.
  void keep(std::size_t part, Cut region);
  void keep_also(std::size_t part, Cut region);

  /// Finds the owners of points of one part; fastest when successive points are near each other.
  class Query {
   public:
    Query(const OwnershipMap& owners, std::size_t part)
        : owners_(owners), part_(static_cast<std::uint32_t>(part)), reader_(owners.grid_) {}

    /// The margin at a point of the part.
    OwnershipMargin margin_at(const SurfacePoint& point);
    float margin(const SurfacePoint& point) { return margin_at(point).margin; }

    /// Whether a point is clearly lost to the same owner as a point beside it, which spares a
    /// query.
    bool is_lost_like(const Loss& beside, const SurfacePoint& point) const {
      return beside.is_clear && owners_.has_surface(beside.owner, point, part_);
    }

    /// The surface at a point of the part by all parts that have some there: the mean along the
    /// point's normal, weighted by inverse variance.
    Vec3f mean_at(const SurfacePoint& point);

    /// Whether another part keeps surface at a point, perhaps the one that it was lost to.
    bool is_kept(const SurfacePoint& point, const Loss& loss);
    /// Whether a part before this one keeps it that had lost it at first.
    bool is_kept_also(const SurfacePoint& point) const;

   private:
    bool is_kept_by(std::uint32_t owner, const SurfacePoint& point) const;
    /// Ties go to the lower number.
    static std::pair<float, std::uint32_t> by_quality(const QualityGrid::Candidate& c) {
      return {c.quality, ~c.number};
    }

    const OwnershipMap& owners_;
    std::uint32_t part_;
    QualityGrid::Reader reader_;
    std::vector<QualityGrid::Candidate> better_;  // than the part, those not asked yet
  };

 private:
  using Views = std::vector<PartView>;  // a pinhole has one, others one per face of a cube

  /// Parts of the surface, as their sensors see them.
  struct Drawn {
    std::vector<Cut> regions;  ///< [parts]
    std::vector<Views> views;  ///< [owners]
  };

  Views views_of(std::size_t part, std::uint32_t source, const Region& region) const;
  void draw(std::size_t part, const Region& region, std::vector<Views>& views);
  void keep(std::size_t part, Cut region, Drawn& in);
  bool has_surface(std::uint32_t owner, const SurfacePoint& point, std::uint32_t of) const;
  bool keeps(const Drawn& in, std::uint32_t owner, const SurfacePoint& point,
             std::uint32_t of) const;

  std::span<const kit::Part> parts_;
  double voxel_m_;
  std::vector<Measured> measured_;
  std::vector<std::uint32_t> first_owner_;  // [parts + 1]
  std::vector<std::uint32_t> same_;         // 0, 1, 2, …: each triangle lies in itself
  QualityGrid grid_;
  std::vector<Views> surface_;  // [owners]
  Drawn kept_, kept_also_;
};

}  // namespace mr::merge
