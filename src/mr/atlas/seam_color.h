#pragma once

#include <span>

#include "mr/atlas/color_field.h"
#include "mr/atlas/view_observations.h"
#include "mr/core/mesh.h"
#include "mr/core/view.h"

namespace mr::atlas {

/// A quality measure: the mean colour difference across texture seams, that is, at mesh edges where
/// the view changes, between the two views' corrected colours at points of the edge (of 255, sRGB,
/// largest channel), weighted by length. `mesh`: with runs, vertices shared. Only points around
/// which both pictures vary by at most `most_contrast` of 255 count: 255 takes all, 12 only plain
/// surface, where a difference is not due to texture or occlusion. 0 if there is no such point.
double seam_color_step(const Mesh& mesh, std::span<const View> views, const Pictures& pictures,
                       const ColorCorrections& corrections, int most_contrast = 255);

}  // namespace mr::atlas
