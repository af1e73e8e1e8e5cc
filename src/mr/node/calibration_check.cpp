#include "mr/node/calibration_check.h"

#include <algorithm>
#include <utility>

#include "mr/calib/outliers.h"
#include "mr/core/parallel.h"

namespace mr::node {
namespace {

constexpr int kCheckEvery = 30;  // ticks
constexpr double kOdd_mm = 20;   // larger residuals are reported
constexpr int kRefineEvery = 3;  // ticks

bool is_over(const std::optional<std::uint64_t>& last, int every, std::uint64_t tick) {
  return !last || tick >= *last + every;
}

std::uint64_t id_of(const kit::Part& part) { return number_of(part.sources.front().sensor); }

calib::RegistrationConfig registration(const Scene& scene) { return {.voxel_m = scene.voxel_m}; }

}  // namespace

CalibrationCheck::CalibrationCheck(const Scene& scene)
    : scene_(&scene),
      refiner_(registration(scene)),
      corrector_(registration(scene), scene.merge.agree_m) {}

/// A sensor's id; of a merger's part, the first sensor's id and how many others there are.
std::string CalibrationCheck::name(const kit::Part& part) const {
  const std::string& first = scene_->sensor(part.sources.front().sensor).id;
  return part.sources.size() == 1 ? first : first + "+" + std::to_string(part.sources.size() - 1);
}

bool CalibrationCheck::is_due(std::uint64_t tick) const {
  return !is_settled_ && is_over(measured_, kCheckEvery, tick);
}

bool CalibrationCheck::update(const std::vector<kit::Part>& parts, std::uint64_t tick) {
  is_settled_ = true;
  if (parts.size() < 2) return false;
  std::vector<std::uint64_t> ids;
  for (const kit::Part& part : parts) ids.push_back(id_of(part));
  bool changed = false;
  if (scene_->merge.refine && (is_over(refined_, kRefineEvery, tick) ||
                               corrections_.size() != parts.size() || ids != ids_)) {
    std::vector<Pose> corrections = refiner_.update(parts, ids);
    changed = std::exchange(corrections_, corrections) != corrections;
    ids_ = ids, refined_ = tick;
  }
  const bool measures = is_over(measured_, kCheckEvery, tick);
  if (measures) {
    std::vector<kit::Part> refined = parts;
    refine(refined);
    changed |= corrector_.update(refined, ids);
    changed |= measure(parts);
    measured_ = tick;
  }
  is_settled_ = measures && !changed;
  return changed;
}

/// Whether other parts are left out than before.
bool CalibrationCheck::measure(const std::vector<kit::Part>& parts) {
  const auto pairs = calib::pair_residuals(parts, registration(*scene_));
  residuals_.clear();
  for (const calib::PairResidual& pair : pairs) {
    residuals_.push_back({name(parts[pair.a]), name(parts[pair.b]), pair.residual_mm,
                          pair.shared_m2, pair.residual_mm});
    for (const calib::PairResidual& after : corrector_.residuals())
      if (after.a == pair.a && after.b == pair.b)
        residuals_.back().corrected_mm = after.residual_mm;
  }
  const double limit_mm = scene_->merge.leave_out_mm > 0 ? scene_->merge.leave_out_mm : kOdd_mm;
  std::vector<std::string> misfits;
  for (const std::uint32_t i : calib::outliers(pairs, parts.size(), limit_mm))
    misfits.push_back(name(parts[i]));
  if (misfits == misfits_) return false;
  misfits_ = std::move(misfits);
  notice_ = misfits_.empty() ? "all inputs fit each other again" : "";
  for (const std::string& misfit : misfits_)
    *notice_ += (notice_->empty() ? "" : "; ") + ("'" + misfit + "' does not fit its neighbours") +
                (scene_->merge.leave_out_mm > 0
                     ? " and is left out"
                     : ": check its pose, or set merge.leave_out_mm to leave such sensors out");
  return scene_->merge.leave_out_mm > 0;
}

bool CalibrationCheck::is_left_out(const kit::Part& part) const {
  return scene_->merge.leave_out_mm > 0 &&
         std::ranges::find(misfits_, name(part)) != misfits_.end();
}

/// Moves parts as they were refined, where they were.
void CalibrationCheck::refine(std::vector<kit::Part>& parts) const {
  if (corrections_.size() != parts.size()) return;
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) calib::move_part(corrections_[i], parts[i]);
  });
}

void CalibrationCheck::apply(std::vector<kit::Part>& parts) const {
  if (parts.size() < 2) return;
  for (kit::Part& part : parts)
    if (is_left_out(part)) part.mesh = {};
  refine(parts);
  calib::bend(bends(parts), parts);
}

calib::Bends CalibrationCheck::bends(const std::vector<kit::Part>& parts) const {
  calib::Bends out(parts.size());
  for (std::size_t i = 0; i < parts.size() && parts.size() > 1; ++i)
    if (const calib::DepthCorrection* known = corrector_.of(id_of(parts[i])))
      out[i].emplace(parts[i]).offset_m = known->offset_m;
  return out;
}

void CalibrationCheck::apply(const std::vector<kit::Part>& parts, std::vector<View>& views,
                             std::vector<SourceInfo>& sources) const {
  if (corrections_.size() != parts.size()) return;
  for (std::size_t i = 0; i < parts.size(); ++i)
    for (const SourceInfo& corrected : parts[i].sources) {
      for (SourceInfo& s : sources)
        if (s.sensor == corrected.sensor) s.T_world_depth = corrected.T_world_depth;
      for (View& view : views)
        if (view.id == view_of(corrected.sensor))
          view.T_world_camera = corrections_[i] * view.T_world_camera;
    }
}

}  // namespace mr::node
