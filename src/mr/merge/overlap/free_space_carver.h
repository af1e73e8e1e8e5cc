#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/merge/overlap/overlap.h"
#include "mr/merge/overlap/still_surface_mask.h"

namespace mr::merge {

/// Still surface that its own sensor does not see, because somebody stands before it, while another
/// sensor sees past its place: it was carried away behind somebody's back (DESIGN section 9, The
/// merger). Decided by tiles of the own sensor's depth picture; only where another sensor measures
/// its own still surface beyond is there emptiness, and not where it measures nothing.
class FreeSpaceCarver {
 public:
  explicit FreeSpaceCarver(const OverlapConfig& config) : config_(config) {}

  /// Takes a capture. `cover`: the still surfaces as the sensors see them; `sources`: what each
  /// confirms now. Returns the area in m² of the places that became empty, or were so wrongly:
  /// their own sensor confirms them.
  double update(const StillSurfaceMask& cover, std::span<const SourceInfo> sources);

  /// What is left of a still surface whose triangles have the sensors that measured them as views.
  Mesh carved(const Mesh& still) const;

 private:
  struct Tile {
    int empty_for = 0;  ///< captures in a row
    bool is_empty = false;
    float depth_m = 0;  ///< of the surface that is gone
    /// Of a surface that its own sensor confirmed while another saw past it; 0: none.
    float disputed_m = 0;
  };
  struct Tiles {
    int tile_px = 0, columns = 0, rows = 0;
    std::vector<Tile> tiles;
    // As the sensor's view in the cover was.
    double scale = 1;
    Camera camera;
    Pose T_camera_world;
  };

  bool sees_past(const StillSurfaceMask::SensorView& own, const StillSurfaceMask::SensorView& other,
                 const TileMask& confirmed, int x, int y) const;
  using Confirmed = std::map<std::uint32_t, const TileMask*>;
  using Samples = std::array<std::array<int, 2>, 9>;  // pixels of the own sensor's view in a tile
  static float nearest_in(const StillSurfaceMask::SensorView& own, const Samples& samples);
  bool any_sees_past(const StillSurfaceMask::SensorView& own, const StillSurfaceMask& cover,
                     const Confirmed& confirmed, const Samples& samples, float nearest) const;
  void follow(const StillSurfaceMask::SensorView& own, const StillSurfaceMask& cover,
              const Confirmed& confirmed, const Samples& samples, Tile& tile) const;
  double follow(const StillSurfaceMask::SensorView& own, const StillSurfaceMask& cover,
                const Confirmed& confirmed, Tiles& tiles) const;
  double find_large(const StillSurfaceMask::SensorView& own, Tiles& tiles) const;

  OverlapConfig config_;
  std::map<std::uint32_t, Tiles> tiles_;  ///< by sensor
  std::uint64_t updates_ = 0;
};

}  // namespace mr::merge
