#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mr/calib/depth_correction.h"
#include "mr/calib/pose_refiner.h"
#include "mr/core/view.h"
#include "mr/kit/part.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// Residual distance between two inputs' surfaces in the region that both see.
struct InputResidual {
  std::string a, b;
  double residual_mm = 0, shared_m2 = 0;
  double corrected_mm = 0;  ///< residual_mm once both are corrected (merge.agree_m)
};

/// Online calibration check of a merger: measures the residuals between its inputs, reports
/// outliers, leaves them out if the scene says so (merge.leave_out_mm), bends the others so that
/// they meet (merge.agree_m), and refines their poses (merge.refine).
class CalibrationCheck {
 public:
  /// The scene must outlive the check.
  explicit CalibrationCheck(const Scene& scene);

  /// Measures the parts, one per input, and finds how they are to be bent and their poses refined;
  /// each only so many ticks after the last time, as it is expensive. True: the corrections
  /// changed; surfaces lie elsewhere than before.
  bool update(const std::vector<kit::Part>& parts, std::uint64_t tick);
  /// Whether parts that stay as they are must be measured again: they have not been since they
  /// changed, or their corrections go on.
  bool is_due(std::uint64_t tick) const;
  /// Corrects the poses of parts where merge.refine is set, and of their sources, then bends their
  /// meshes (merge.agree_m); empties those of parts that are left out. As many parts as update()
  /// was given, of the same inputs.
  void apply(std::vector<kit::Part>& parts) const;
  /// The same for views and sources as received; `parts`: corrected.
  void apply(const std::vector<kit::Part>& parts, std::vector<View>& views,
             std::vector<SourceInfo>& sources) const;

  /// How parts are bent, from where their sensors stand now.
  calib::Bends bends(const std::vector<kit::Part>& parts) const;

  /// The residuals of the last measurement.
  const std::vector<InputResidual>& residuals() const { return residuals_; }
  /// A message for the log if the set of outliers has changed; returned once.
  std::optional<std::string> take_notice() { return std::exchange(notice_, std::nullopt); }

 private:
  std::string name(const kit::Part& part) const;
  bool measure(const std::vector<kit::Part>& parts);
  void refine(std::vector<kit::Part>& parts) const;
  bool is_left_out(const kit::Part& part) const;

  const Scene* scene_;
  calib::PoseRefiner refiner_;
  calib::DepthCorrector corrector_;
  std::optional<std::uint64_t> measured_, refined_;  ///< ticks
  bool is_settled_ = true;  ///< no more is to be corrected in the last parts
  std::vector<Pose> corrections_;
  std::vector<std::uint64_t> ids_;  ///< of the parts that corrections_ belong to
  std::vector<InputResidual> residuals_;
  std::vector<std::string> misfits_;
  std::optional<std::string> notice_;
};

}  // namespace mr::node
