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

/// Space carving for the still surface (docs/layers.md, The merger): removes surface that its own
/// sensor cannot see at present, because it is occluded, while another sensor sees through its
/// place: the object was carried away behind an occluder. Decided per tile of the own sensor's
/// depth picture. Only another sensor's still surface farther away is evidence of free space;
/// missing depth is not.
class FreeSpaceCarver {
 public:
  explicit FreeSpaceCarver(const OverlapConfig& config) : config_(config) {}

  /// Processes a capture. `cover`: depth maps of the still surfaces; `sources`: tiles that each
  /// sensor confirms now. Returns the area in m² whose state changed: carved, or restored because
  /// its own sensor confirms it again.
  double update(const StillSurfaceMask& cover, std::span<const SourceInfo> sources);

  /// A still surface without carved tiles. Its triangles' views must be the sensors that measured
  /// them.
  Mesh carved(const Mesh& still) const;

 private:
  struct Tile {
    int empty_for = 0;  ///< captures in a row
    bool is_empty = false;
    float depth_m = 0;  ///< of the surface that is gone
    /// Depth of a surface that its own sensor confirmed while another one saw through it; 0: none.
    float disputed_m = 0;
  };
  struct Tiles {
    int tile_px = 0, columns = 0, rows = 0;
    std::vector<Tile> tiles;
    // The sensor's view in the cover at the last update.
    double scale = 1;
    Camera camera;
    Pose T_camera_world;
  };

  bool sees_past(const StillSurfaceMask::SensorView& own, const StillSurfaceMask::SensorView& other,
                 const TileMask& confirmed, int x, int y) const;
  using Confirmed = std::map<SensorId, const TileMask*>;
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
  std::map<SensorId, Tiles> tiles_;  ///< by sensor
  std::uint64_t updates_ = 0;
};

}  // namespace mr::merge
