#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/synth/posed_camera.h"

namespace mr::synth {

/// The tiles of a camera's picture in which something may be visible: a conservative bound on the
/// pixels whose rays have to be cast.
class TileCoverage {
 public:
  static constexpr int kTile = 8;  ///< pixels

  TileCoverage() = default;
  TileCoverage(int width, int height);

  /// Marks the tiles that the mesh's triangles touch, and those within two pixels of them.
  void add(const Mesh& mesh, const PosedCamera& eye);

  /// Adds the tiles of another coverage of the same picture (union).
  void add(const TileCoverage& other);

  bool holds(int x, int y) const {
    return marks_[static_cast<std::size_t>(y / kTile) * columns_ + x / kTile] != 0;
  }
  /// Calls body(tile) for every marked tile; rows of tiles in parallel.
  void for_tiles(const std::function<void(Rect)>& body) const;
  /// Calls body(y, begin, end) for runs of marked pixels, row by row, from left to right.
  void for_runs(const std::function<void(int y, int begin, int end)>& body) const;

 private:
  void mark(Vec2d low, Vec2d high);

  int width_ = 0, height_ = 0, columns_ = 0, rows_ = 0;
  std::vector<std::uint8_t> marks_;  // [rows * columns]
};

}  // namespace mr::synth
