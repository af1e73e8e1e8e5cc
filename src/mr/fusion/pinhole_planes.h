#pragma once

#include "mr/fusion/frame_view.h"

namespace mr::fusion {

/// Fits the plane of every pixel of a pinhole picture (FrameView::planes), parallel over rows.
/// Neighbours belong to one surface when the line through them is not nearly parallel to a ray, or
/// when it is part of a longer line that goes one way: noise and mixed pixels move the pixels of a
/// grazing surface by up to a step, but at a depth edge one or two steps are nearly all of it.
void fit_pinhole_planes(FrameView& view);

}  // namespace mr::fusion
