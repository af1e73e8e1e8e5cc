#pragma once

#include <map>
#include <span>

#include "mr/atlas/color_field.h"
#include "mr/atlas/color_fit.h"
#include "mr/atlas/view_observations.h"
#include "mr/core/mesh.h"
#include "mr/core/view.h"

namespace mr::atlas {

/// One colour for a surface that several cameras see: estimates a ColorField for each view from
/// points of the surface that several views see (color_fit.h). Sticky: fields are the same to the
/// bit while the estimate differs from them by less than 1.5 %. Deterministic.
class ColorBalance {
 public:
  /// What the cameras show of a surface.
  struct Capture {
    const Mesh& mesh;             ///< merged; metres of the views' world
    std::span<const View> views;  ///< each with the stream whose picture shows it
    const Pictures& pictures;
    const ValidTiles& valid;
  };

  /// Estimates anew. Fields of known views go to the new estimate; those of new views start there.
  /// `share` of the way to the new estimate, 0..1: below 1 the estimate is smoothed over calls.
  void estimate(const Capture& capture, float share);
  /// Moves the fields towards the estimate, by at most 1 % of light; `at_once`: all the way.
  void follow(bool at_once);

  /// The fields of the views of the last estimate; empty fields change nothing.
  const std::map<ViewId, ColorField>& fields() const { return fields_; }

  /// What the last estimate found about a view, for reports.
  struct Finding {
    bool overlaps = false;  ///< with other views
    Vec3f gain{1, 1, 1};    ///< mean factor on its linear light
    double misfit = 0;      ///< ViewFit::misfit
  };
  const std::map<ViewId, Finding>& findings() const { return findings_; }
  /// ColorFit::misplaced_px of the last estimate.
  double misplaced_px() const { return misplaced_px_; }

 private:
  std::map<ViewId, ColorField> wanted_;  ///< the smoothed estimate
  std::map<ViewId, ColorField> fields_;
  std::map<ViewId, Finding> findings_;
  double misplaced_px_ = 0;
  bool is_moving_ = false;  ///< until the fields reach the estimate
};

}  // namespace mr::atlas
