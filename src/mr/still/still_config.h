#pragma once

#include <string>
#include <vector>

#include "mr/core/range.h"

namespace mr::still {

/// The scene's two layers (docs/layers.md): the still surface is kept, the moving one is
/// reconstructed from every capture.
struct StillConfig {
  bool layers = true;  ///< false: everything is reconstructed from every capture
  double after_s = 5;  ///< seconds after which an object that stopped becomes background

  static constexpr Range kAfter_s{0.5, 3600};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    return out_of_range({{"after_s", after_s, kAfter_s}});
  }
  friend bool operator==(const StillConfig&, const StillConfig&) = default;
};

}  // namespace mr::still
