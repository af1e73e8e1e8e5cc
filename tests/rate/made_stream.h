#pragma once

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "mr/rate/controller.h"
#include "mr/rate/curve_predictor.h"
#include "rate/made_sweeps.h"

namespace mr::rate {

inline std::shared_ptr<const Model> made_model() {
  static const auto model =
      std::make_shared<const CurvePredictor>(CurvePredictor::train(made_training()));
  return model;
}

/// Scenes unlike those that made_model() was trained on.
inline std::vector<MadeScene> made_other_scenes() {
  return {{"usual", true, 1.1, 1, 0.095, 0.3, 6},
          {"quiet", true, 0.6, 1.5, 0.1, 0.25, 6},
          {"full", true, 2.8, 0.9, 0.09, 0.35, 8},
          {"full anew", false, 1.8, 1.4, 0.1, 0.3, 5}};
}

/// The rate of a scene under a setting, key frames once a second.
inline double made_mbps(const MadeScene& scene, const Setting& s) {
  return (scene.fps * made_geometry_bytes(scene, s.error_voxels) +
          (scene.fps - 1 + scene.key_ratio) * made_texture_bytes(scene, s.scale, s.qp)) *
         8e-6;
}
inline double made_least_mbps(const MadeScene& scene) {
  return made_mbps(scene, {6, kBits, 0.5, 50});
}
inline double made_most_mbps(const MadeScene& scene) {
  return made_mbps(scene, {0.5, kBits, 1, 18});
}

/// A controller with a scene that takes what its closed form says, capture by capture.
struct MadeStream {
  struct Capture {
    CapturePlan plan;
    Setting setting;  ///< in force
    double target_mbps = 0, mbps = 0, backlog = 0, backlog_share = 0;
    bool is_best_effort = false;
  };

  explicit MadeStream(const MadeScene& of, double target_mbps)
      : scene(of), controller(made_model(), of.layers, of.fps, target_mbps) {
    controller.set_features(made_sweep(of).features);
  }

  void run(double seconds) {
    const auto count = static_cast<std::size_t>(seconds * scene.fps + 0.5);
    for (std::size_t i = 0; i < count; ++i) step();
  }

  void step() {
    const bool is_due = key_frame_every > 0 && captures.size() % key_frame_every == 0;
    const bool key_frame = captures.empty() || is_due || std::exchange(key_frame_asked, false);
    CapturePlan plan =
        controller.begin({.plate_bytes = backlog, .plate_qp = backlog_qp, .best_plate_qp = 20});
    CaptureBytes bytes;
    key_frame_needed |= key_frame || plan.key_frame;
    plan.key_frame = key_frame_needed;
    if (!plan.skipped) {
      bytes.geometry = made_geometry_bytes(scene, plan.setting.error_voxels);
      const CaptureBudget budget = controller.code({bytes.geometry, backlog, key_frame_needed});
      plan.setting.qp = budget.qp, plan.refinement = budget.refinement;
      bytes.key_frame = std::exchange(key_frame_needed, false);
      bytes.texture = made_texture_bytes(scene, plan.setting.scale, plan.setting.qp) *
                      (bytes.key_frame ? scene.key_ratio : 1);
      if (budget.refinement >= least_piece) bytes.refinement = std::min(budget.refinement, backlog);
    }
    const double before = backlog;
    backlog -= bytes.refinement;
    controller.sent(bytes);
    captures.push_back({plan, controller.setting(), controller.target_mbps(),
                        (bytes.geometry + bytes.texture + bytes.refinement) * 8e-6 * scene.fps,
                        before, controller.backlog_share(), controller.is_best_effort()});
  }

  /// Mean rate of the captures from `from_s` to `to_s`.
  double mbps(double from_s, double to_s) const {
    double sum = 0;
    const auto first = static_cast<std::size_t>(from_s * scene.fps + 0.5),
               end = static_cast<std::size_t>(to_s * scene.fps + 0.5);
    for (std::size_t i = first; i < end; ++i) sum += captures.at(i).mbps;
    return sum / static_cast<double>(end - first);
  }

  MadeScene scene;
  Controller controller;
  std::size_t key_frame_every = 250;  ///< 0: the first alone
  double backlog = 0;                 ///< bytes of plates that wait
  double backlog_qp = 36;             ///< of the plates as shown
  bool key_frame_asked = false;       ///< for the next one
  bool key_frame_needed = false;      ///< and not sent yet
  double least_piece = 0;             ///< bytes; the backlog is not sent in smaller pieces
  std::vector<Capture> captures;
};

}  // namespace mr::rate
