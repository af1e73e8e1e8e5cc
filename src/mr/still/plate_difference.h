#pragma once

#include <array>
#include <cstdint>
#include <utility>

#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/core/vec.h"
#include "mr/still/tiles.h"

namespace mr::still {

/// What a place of a colour picture shows, beside the clean plate.
enum class PlateColor : std::uint8_t {
  unknown,    ///< there is no plate
  same,       ///< the room, perhaps in shadow
  dark,       ///< as dark as hair and black cloth, before something dark
  unsure,     ///< in between
  different,  ///< not the room
};

/// Where a colour picture differs from its clean plate (background subtraction; shadows as in
/// Horprasert et al. 1999), on a plane with a pixel for AlphaPlane::kStep_px squared. Blocks are
/// compared when they are first asked for, so the cost is proportional to what is looked at.
class PlateDifference {
 public:
  static constexpr int kStep_px = AlphaPlane::kStep_px;
  static constexpr int kBlock_px = kColorTile_px / kStep_px;  ///< of the plane

  /// The pictures of one moment, of one size. They must outlive the comparison.
  struct Input {
    const ImageRgb& color;
    const ImageRgb& plate;  ///< of the room without what moves
    const TileMask& known;  ///< where there is a plate: tiles of kColorTile_px
    Vec3f gain;             ///< plate times gain: the room at this capture's exposure
  };
  /// `was_different`: take_different() of the capture before; empty: there is none. What was found
  /// to be different stays so for less. It must outlive the comparison.
  PlateDifference(const Input& in, const ImageMask& was_different);

  int width() const { return colors_.width; }
  int height() const { return colors_.height; }
  /// Of a pixel of the plane.
  PlateColor at(int x, int y);
  /// What was found to be different, for the next capture. Pixels that were not looked at are 0.
  ImageMask take_different() { return std::move(different_); }

 private:
  void compare(int column, int row);
  PlateColor compare(int x, int y, bool was_different) const;
  std::array<int, 3> mean_of(const ImageRgb& picture, int x, int y) const;

  Input in_;
  const ImageMask& was_different_;
  Image<PlateColor, 1> colors_;  ///< of compared blocks
  ImageMask is_compared_;        ///< blocks
  ImageMask different_;
};

}  // namespace mr::still
