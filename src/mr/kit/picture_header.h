#pragma once

namespace mr::kit {

/// What the header of a picture file says.
struct PictureHeader {
  int width = 0, height = 0;
  int bits = 8;       ///< per channel
  bool grey = false;  ///< one channel without palette or alpha
};

}  // namespace mr::kit
