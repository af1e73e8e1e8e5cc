#pragma once

#include <compare>

namespace mr::rate {

/// By how much the logarithms of the bytes of two neighbouring quantisers differ: these halve with
/// every sixth.
inline constexpr double kPerQp = 0.1155;

/// The coding parameters that rate control varies: decimation and texture from second to second,
/// the lattice with an epoch.
struct Setting {
  double error_voxels = 0.5;  ///< error limit of decimating the moving surface, in voxels
  int bits = 10;              ///< positions on a lattice of steps of 2^-bits m; of a whole epoch
  double scale = 1;           ///< texture_scale of live tiles
  int qp = 28;                ///< H.264 quantiser of live tiles

  friend auto operator<=>(const Setting&, const Setting&) = default;
};

}  // namespace mr::rate
