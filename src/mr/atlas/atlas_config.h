#pragma once

namespace mr::atlas {

struct AtlasConfig {
  enum class Views { coherent, best_angle, packed, separate } views = Views::coherent;
  bool mask = true;                 ///< pixels of no use become black
  bool burn_sequence = false;       ///< test pictures: the packet's number in the corner
  int width = 4096, height = 2304;  ///< the atlas is at most this large
  friend bool operator==(const AtlasConfig&, const AtlasConfig&) = default;
};

}  // namespace mr::atlas
