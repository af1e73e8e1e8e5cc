#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mr/calib/pose_refiner.h"
#include "mr/core/view.h"
#include "mr/kit/part.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// How far two inputs' surfaces lie apart where both see the same.
struct InputResidual {
  std::string a, b;
  double residual_mm = 0, shared_m2 = 0;
};

/// What a merger does about calibration: it measures how well its inputs fit, says which one does
/// not, leaves that out if the scene wants it, and aligns the others (merge.refine).
class CalibrationCheck {
 public:
  /// The scene must outlive the check.
  explicit CalibrationCheck(const Scene& scene);

  /// Looks at the parts, one per input; not closely at each call, for it takes
  /// time.
  void look(const std::vector<kit::Part>& parts);
  /// Corrects the poses of parts where merge.refine is set, and of their sources; empties the
  /// meshes of parts that are left out. As many parts as look() was given, of the same inputs.
  void apply(std::vector<kit::Part>& parts) const;
  /// The same for views and sources, as they came; `parts`: corrected.
  void apply(const std::vector<kit::Part>& parts, std::vector<View>& views,
             std::vector<SourceInfo>& sources) const;

  /// Of the last look.
  const std::vector<InputResidual>& residuals() const { return residuals_; }
  /// One line for people when the inputs that do not fit changed; forgets it.
  std::optional<std::string> take_notice() { return std::exchange(notice_, std::nullopt); }

 private:
  std::string name(const kit::Part& part) const;
  void measure(const std::vector<kit::Part>& parts);
  bool is_left_out(const kit::Part& part) const;

  const Scene* scene_;
  calib::PoseRefiner refiner_;
  int calls_ = 0;
  std::vector<Pose> corrections_;
  std::vector<std::uint64_t> ids_;  ///< of the parts that they belong to
  std::vector<InputResidual> residuals_;
  std::vector<std::string> misfits_;
  std::optional<std::string> notice_;
};

}  // namespace mr::node
