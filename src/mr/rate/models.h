#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "mr/core/result.h"
#include "mr/rate/classifier.h"
#include "mr/rate/curve_predictor.h"
#include "mr/rate/lookup_table.h"
#include "mr/rate/model.h"
#include "mr/rate/rate_config.h"

namespace mr::rate {

/// All models that a scene may name, trained on the same sweeps.
struct Models {
  static constexpr int kVersion = 3;  ///< of the file

  Classifier classifier;
  LookupTable lookup;
  CurvePredictor ours;

  /// `sweeps`: complete (is_complete()), of several scenes; not empty.
  static Models train(std::span<const Sweep> sweeps);
  /// A copy of one of them. `which` must not be fixed.
  std::shared_ptr<const Model> get(RateConfig::Model which) const;
};

/// The model file: JSON, with its version.
std::string to_json(const Models& models);
/// Untrusted text. Errors: corrupt; unsupported: of another version; too_large. One line.
Result<Models> models_from_json(std::string_view text);

/// The models that this program was built with (src/mr/rate/models.json).
const Result<Models>& shipped_models();

/// The model that a scene names; null: fixed. Where its file cannot be used, `notice` gets one
/// line, and the program's own model takes its place. Error: the program's own are damaged.
Result<std::shared_ptr<const Model>> open_model(
    const RateConfig& config, const std::function<void(const std::string&)>& notice);

/// The lattice of an epoch, its bits, as the scene's model chooses it for the target before
/// anything is known of the scene. Fixed, or a damaged model of the program's own: the usual one.
int lattice_of_epoch(const RateConfig& config, bool layers, double voxel_m);

}  // namespace mr::rate
