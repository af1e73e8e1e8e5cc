#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "mr/core/ids.h"
#include "mr/core/vec.h"
#include "mr/core/view.h"

namespace mr::atlas {

/// A correction of a view's colour: factors on linear red, green and blue light that vary slowly
/// over the camera's picture, for exposure, white balance, vignetting, and a lens or a sensor that
/// is not even.
struct ColorField {
  static constexpr int kColumns = 16, kRows = 9;
  static constexpr int kNodes = kColumns * kRows;

  /// [kRows, kColumns] logarithms of the factors at the middles of equal cells of the picture;
  /// bilinear between them, constant beyond the outer ones. Empty: all factors are 1.
  std::vector<Vec3f> log_gain;

  bool empty() const { return log_gain.empty(); }
  /// The logarithms at a place, both coordinates 0..1 across the picture.
  Vec3f at(Vec2f place) const;
  /// The mean over the picture.
  Vec3f mean() const;

  friend bool operator==(const ColorField&, const ColorField&) = default;
};

/// The nodes of a ColorField around a place, and how much each of them counts there.
struct FieldWeights {
  std::array<std::uint16_t, 4> node;
  std::array<float, 4> weight;  ///< sum 1
};
FieldWeights field_weights(Vec2f place);

/// What is done to the colours of one view's pictures.
struct ColorCorrection {
  ColorField field;
  /// Logarithms of further factors, on the newest picture only: what brings it to the exposure at
  /// which the picture behind it, the clean plate, was taken.
  Vec3f log_exposure;

  friend bool operator==(const ColorCorrection&, const ColorCorrection&) = default;
};
using ColorCorrections = std::map<ViewId, ColorCorrection>;

/// The byte of sRGB for a byte whose linear light is multiplied by a factor. Factors over 1 end in
/// a shoulder: from half of white on, the curve bends so that white stays white, and only what was
/// clipped (254 and more) is clipped. A factor of 1 changes nothing. Factors are rounded to 1/128
/// of a stop and limited to 4 stops.
class ToneCurves {
 public:
  using Curve = std::array<std::uint8_t, 256>;

  static const Curve& of(float log_gain) { return all()[index(log_gain)]; }
  static constexpr int kPerStop = 128, kMostStops = 4;

 private:
  static std::size_t index(float log_gain);
  static const std::vector<Curve>& all();
};

/// Corrects rows of a view's tile.
class TileShader {
 public:
  /// `extra`: logarithms of factors besides the field's.
  TileShader(const View& tile, const ColorField& field, Vec3f extra);

  /// Whether nothing is changed.
  bool is_plain() const { return is_plain_; }
  /// Corrects `count` pixels of the tile's row `y` in place, from column `x` on; `rgb`: of the
  /// first of them.
  void apply(int x, int y, int count, std::uint8_t* rgb) const;
  /// The curves of red, green and blue at a pixel of the tile.
  const std::array<const std::uint8_t*, 3>& curves(int x, int y) const {
    return curves_[static_cast<std::size_t>(y / kBlock_px) * columns_ + x / kBlock_px];
  }

 private:
  static constexpr int kBlock_px = 8;  ///< pixels of a tile that share their factors

  bool is_plain_ = true;
  int columns_ = 0;                                         ///< blocks in a row
  std::vector<std::array<const std::uint8_t*, 3>> curves_;  ///< [rows, columns] of blocks
};

}  // namespace mr::atlas
