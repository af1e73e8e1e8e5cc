#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "mr/calib/registration_config.h"
#include "mr/calib/residuals.h"
#include "mr/core/camera.h"
#include "mr/core/pose.h"
#include "mr/kit/part.h"

namespace mr::calib {

/// A smooth function over what a part's sensor sees: how far each point is moved along the ray to
/// it. Nodes lie on a grid over the picture of a pinhole camera; for others, and for parts of
/// several sensors, on a grid of directions around the middle of these, whose columns go all
/// around.
class DepthCorrection {
 public:
  static constexpr int kColumns = 12, kRows = 9;
  static constexpr std::size_t kNodes = std::size_t{kColumns} * kRows;

  explicit DepthCorrection(const kit::Part& part);

  /// Bilinear weights of the nodes around the direction to a point; world frame.
  struct Weights {
    std::array<std::uint32_t, 4> node{};
    std::array<double, 4> weight{};  ///< sum to 1
  };
  Weights weights(Vec3d point) const;
  Vec3d eye() const { return eye_; }
  bool goes_around() const { return camera_.width == 0; }
  /// Noise of the sensor at a point, 1 sigma.
  double noise_m(Vec3d point) const { return precision_.sigma_m(length(point - eye_)); }

  std::vector<double> offset_m = std::vector<double>(kNodes, 0.0);  ///< away from the sensor

  double offset_at(Vec3d point) const;
  Vec3d moved(Vec3d point) const { return point + normalized(point - eye_) * offset_at(point); }

  friend bool operator==(const DepthCorrection&, const DepthCorrection&) = default;

 private:
  Camera camera_;  ///< a pinhole, or without pixels: a grid of directions
  Pose T_camera_world_;
  Vec3d eye_;
  Precision precision_;  ///< of the first sensor
};

/// Moves the vertices of a part.
void correct(const DepthCorrection& correction, kit::Part& part);

/// The corrections of several parts, none where a part has none.
using Bends = std::vector<std::optional<DepthCorrection>>;

/// Moves the vertices of as many parts.
void bend(const Bends& bends, std::span<kit::Part> parts);

struct PairOverlap;  // overlaps.h

/// Online correction of what calibration leaves: bent depth fields, scale, small errors of pose.
/// Where the surfaces of two parts lie apart by more than noise and less than `agree_m`, each is
/// bent smoothly towards the other, so that both meet in the middle: weighted least squares over
/// the point-to-plane distances of all pairs at once, with a membrane's energy on each part's grid,
/// robust against what is not the same surface. Parts that disagree with most others (outliers())
/// are neither bent nor bent towards. At first all the way at once; afterwards slowly, and only if
/// it is worth it, as every change moves a whole surface.
class DepthCorrector {
 public:
  DepthCorrector(const RegistrationConfig& config, double agree_m)
      : config_(config), agree_m_(agree_m) {}

  /// Takes the uncorrected parts, identified by `ids`; a part that was absent goes on with what it
  /// had. True: the corrections changed. Costs two to five pair_residuals().
  bool update(std::span<const kit::Part> parts, std::span<const std::uint64_t> ids);

  /// The correction of a part; null: none.
  const DepthCorrection* of(std::uint64_t id) const;

  /// Residuals of the last update's parts once corrected.
  const std::vector<PairResidual>& residuals() const { return residuals_; }

 private:
  std::optional<std::vector<double>> step(const std::vector<PairOverlap>& overlaps,
                                          const std::vector<DepthCorrection>& corrections,
                                          bool at_once) const;

  RegistrationConfig config_;
  double agree_m_;
  std::map<std::uint64_t, DepthCorrection> known_;  ///< by id
  std::vector<PairResidual> residuals_;
};

}  // namespace mr::calib
