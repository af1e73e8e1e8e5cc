#pragma once

#include <string>
#include <vector>

#include "mr/core/range.h"

namespace mr::atlas {

struct AtlasConfig {
  enum class Views { coherent, best_angle, packed, separate } views = Views::coherent;
  bool mask = true;                 ///< unused pixels become black
  bool burn_sequence = false;       ///< for tests: draws the packet's number as a watermark
  int width = 4096, height = 2304;  ///< largest size of the atlas, pixels

  static constexpr Range kSize{16, 8192};  // pixels
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    return out_of_range({{"size", width, kSize}, {"size", height, kSize}});
  }
  friend bool operator==(const AtlasConfig&, const AtlasConfig&) = default;
};

}  // namespace mr::atlas
