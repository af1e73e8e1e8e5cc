#pragma once

namespace mr::still {

/// The scene's two surfaces (DESIGN section 9): what stays is kept, what moves is made anew.
struct StillConfig {
  bool layers = true;  ///< false: everything is made anew with every capture
  double after_s = 5;  ///< what stopped becomes part of the room after so long
  friend bool operator==(const StillConfig&, const StillConfig&) = default;
};

}  // namespace mr::still
