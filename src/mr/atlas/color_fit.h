#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mr/atlas/color_field.h"
#include "mr/core/vec.h"

namespace mr::atlas {

/// One point of the surface in the pictures of two views.
struct LightPair {
  std::size_t first = 0, second = 0;  ///< indices of the views
  Vec2f place_first, place_second;    ///< in their camera pictures, both coordinates 0..1
  Vec3f log_ratio;                    ///< of linear light, first over second
  float weight = 0;                   ///< 0..1
  float slope = 0;                    ///< of log light around it, per pixel
};

/// What a fit found about one view.
struct ViewFit {
  bool overlaps = false;  ///< with others; else there is no field
  ColorField field;
  /// The part of its light, as a logarithm, by which it differs from the others after correction:
  /// weighted median over its pairs. Large where its colour does not lie on the surface.
  double misfit = 0;
};

struct ColorFit {
  std::vector<ViewFit> views;
  /// How far pictures lie beside each other on the surface, pixels: median of what is left of the
  /// differences over the slope of the light, where that is steep. 0 where nothing is.
  double misplaced_px = 0;
};

/// The fields that make views agree (gain compensation of Brown and Lowe 2007, with a
/// field in place of a gain): a gain per channel, vignetting as an even polynomial of the distance
/// from the picture's middle, and 16x9 nodes that are smooth, by iteratively reweighted least
/// squares (Geman and McClure), so that mirrors, highlights and misplaced pictures count little.
/// The logarithm of the gain of the middle view, of views in order of gain, is 0 (of an even number
/// the brighter of the two in the middle): a camera that is darker than all others changes none of
/// them. Views that do not overlap, not even through others, are apart. `aspects`: [view] height of
/// its picture over width. Serial but for the three channels, which run in parallel.
ColorFit fit_colors(std::span<const float> aspects, std::span<const LightPair> pairs);

}  // namespace mr::atlas
