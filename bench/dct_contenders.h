#pragma once

#include <array>
#include <vector>

#include "mr/core/frame.h"
#include "race.h"

namespace mr::bench {

/// Contenders of scene features, on one thread; one run is one picture. The input must outlive
/// them. The result is {"energy": DCT energy of the picture}.

using LumaPlane = Image<float, 1>;  ///< luma 0..255, or depth in millimetres

inline constexpr int kDctBlock = 32;  ///< pixels a side

/// rate::dct_energy().
Contender dct_ours(const LumaPlane& plane);

/// All features of frames of colour and depth, which take turns; energy of colour.
Contender features_ours(const std::vector<Frame>& frames);

/// cv::dct() of each block.
Contender dct_opencv(const LumaPlane& plane);

/// Whether this was built with FFTW.
bool has_fftw();

/// fftwf_plan_many_r2r() with FFTW_MEASURE over each row of blocks. Empty: built without FFTW.
std::vector<Contender> dct_fftw(const LumaPlane& plane);

/// What |DCT(i, j)| of a block counts, for the peers.
struct DctWeights {
  std::array<float, kDctBlock * kDctBlock> values;

  /// Of the orthonormal DCT. `first`, `other`: further factors in each direction, of frequency 0
  /// and of all others, for a DCT that is not normalised.
  DctWeights(double first, double other);
  /// Σ weight |DCT|, in partial sums that a compiler can keep in vectors.
  float energy(const float* dct) const;
};

}  // namespace mr::bench
