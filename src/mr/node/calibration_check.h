#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mr/core/scene.h"
#include "mr/core/view.h"
#include "mr/merge/part.h"
#include "mr/merge/registration.h"

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

  /// Looks at the parts, one per scene that was gathered; not at each call, for it takes time.
  /// Corrects poses of parts, views and sources where merge.refine is set; empties the meshes of
  /// parts that are left out.
  void run(std::vector<merge::Part>& parts, std::vector<View>& views,
           std::vector<SourceInfo>& sources);

  /// Of the last look.
  const std::vector<InputResidual>& residuals() const { return residuals_; }
  /// One line for people when the inputs that do not fit changed; forgets it.
  std::optional<std::string> take_notice() { return std::exchange(notice_, std::nullopt); }

 private:
  std::string name(const merge::Part& part) const;
  void measure(const std::vector<merge::Part>& parts);
  void leave_out(std::vector<merge::Part>& parts) const;
  void correct(std::vector<merge::Part>& parts, std::vector<View>& views,
               std::vector<SourceInfo>& sources);

  const Scene* scene_;
  merge::Refiner refiner_;
  int calls_ = 0;
  std::vector<Pose> corrections_;
  std::vector<std::uint64_t> ids_;  ///< of the parts that they belong to
  std::vector<InputResidual> residuals_;
  std::vector<std::string> misfits_;
  std::optional<std::string> notice_;
};

}  // namespace mr::node
