#pragma once

namespace mr::still {

/// The scene's two layers (DESIGN section 9): the still surface is kept, the moving one is
/// reconstructed from every capture.
struct StillConfig {
  bool layers = true;  ///< false: everything is reconstructed from every capture
  double after_s = 5;  ///< what stopped moving becomes background after so long
  friend bool operator==(const StillConfig&, const StillConfig&) = default;
};

}  // namespace mr::still
