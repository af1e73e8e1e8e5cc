#pragma once

#include "mr/core/image.h"

namespace mr::baseline {

/// A sensor's depth range, metres.
struct DepthRange {
  double near_m = 0.3, far_m = 5;
};

/// Encodes depth as a grey picture that is robust to lossy video coding (after Pece, Kautz and
/// Weyrich 2011, "Adapting standard video codecs for depth streaming"). Instead of their three
/// channels, which 4:2:0 would subsample, two grey pictures lie one above the other:
///   above  depth in some 190 steps from near to far; black where there is none
///   below  a triangle wave of depth, which gives the position within a step; invalid depth is
///          filled from beside, so that no bits are spent on edges there
/// Size: [2 H, W]. The wave's period, 1 m, gave the least error at equal bits: on the synthetic
/// room 3.2 mm RMS at QP 14, where one grey picture of depth alone stays above 12 mm at any QP.
ImageRgb depth_to_picture(const ImageDepth& depth, const DepthRange& range);

/// Decodes such a picture, which may be padded. Pixels whose two values disagree, as at depth edges
/// blurred by coding, become invalid.
ImageDepth picture_to_depth(const ImageRgb& picture, int width, int height,
                            const DepthRange& range);

}  // namespace mr::baseline
