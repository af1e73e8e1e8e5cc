#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/synth/rig_config.h"

namespace mr::synth {

/// The noiseless measurement of a time-of-flight camera, and flags where the real one fails.
struct DepthTruth {
  enum Flag : std::uint8_t {
    kGrazing = 1,  ///< seen at under 8 degrees: no measurement
    kDark = 2,     ///< little light is reflected: most measurements fail
    kEdge = 4,     ///< depth edge: half of the measurements are mixed pixels
  };

  int width = 0, height = 0;
  /// Neighbouring rows overlap, so that a step between them is an edge; not those of a LiDAR, whose
  /// beams lie far apart.
  bool rows_touch = true;
  std::vector<float> z_mm;          ///< [H*W] 0 where nothing is met
  std::vector<float> beyond_mm;     ///< [H*W] of edges: the neighbour's depth that differs most
  std::vector<std::uint8_t> flags;  ///< [H*W]

  DepthTruth() = default;
  DepthTruth(int w, int h);
};

/// Finds the depth edges in a part of the picture; `part` may reach over its borders.
void find_edges(DepthTruth& truth, Rect part);

/// Whether a surface of this linear colour reflects too little for a time-of-flight camera.
bool is_dark(Vec3f color);

/// The noise model of a depth camera.
struct DepthNoise {
  bool on = true;
  Precision precision;
  double near_m = 0, far_m = 0;  ///< beyond is no measurement
  double factor = 1;             ///< times the precision
  double correlation_px = 0;  ///< correlation of pixels r apart: exp(-r² / (2 · this²)); 0: none
};

/// A nearly normal deviate from a hash: mean 0, standard deviation 1, within ±8.
float normal_deviate(std::uint64_t hash);

/// One frame's measurements in whole millimetres, 0 where there is none. `out`: [H*W]. The same on
/// any number of threads and any platform.
void measure(const DepthTruth& truth, const DepthNoise& noise, std::uint64_t frame_seed,
             std::span<std::uint16_t> out);

}  // namespace mr::synth
