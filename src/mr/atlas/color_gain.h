#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <span>

#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/view.h"

namespace mr::atlas {

/// Factors on a view's linear red, green and blue.
using Gains = std::map<ViewId, Vec3f>;
/// Pictures by stream, as DecodedScene has them.
using Pictures = std::map<StreamId, std::shared_ptr<const ImageRgb>>;

/// [channel][value] lookup tables that apply a view's gain in linear light to 8-bit sRGB, clipped
/// at white. With gain 1 they are the identity.
using GainTables = std::array<std::array<std::uint8_t, 256>, 3>;
GainTables gain_tables(Vec3f gain);

/// Gain compensation (Brown and Lowe 2007): exposure and white balance gains of all views, by least
/// squares over surface points that several views see, so that seams across plain walls are
/// invisible. The geometric mean over overlapping views is kept. Smoothed over time; deterministic.
class ColorBalance {
 public:
  /// Updates the estimate with a frame. `mesh`: the merged surface; `views` as the children have
  /// them, each with the stream whose picture shows it; both in metres of one world. Cheap: a few
  /// thousand samples. A new view gets its gain at once; later changes take about 30 calls, and
  /// gains stay bit-identical while the estimate differs by less than 0.6 % (hysteresis).
  void update(const Mesh& mesh, std::span<const View> views, const Pictures& pictures);

  /// The gain of each view of the last update(), within [1/3, 3]; 1 for views without overlap.
  const Gains& gains() const { return gains_; }

  /// The logarithm of a view's gain in one channel, over time.
  struct Channel {
    double smoothed = 0, used = 0;
    bool moving = false;  ///< `used` follows `smoothed` until it reaches it

    void start(double wanted);
    void follow(double wanted);
  };
  using Balance = std::array<Channel, 3>;

 private:
  std::map<ViewId, Balance> balances_;
  Gains gains_;
};

/// A quality measure: the mean colour difference across texture seams, that is, at mesh edges where
/// the view changes, between the two views' colours at points of the edge (of 255, sRGB, largest
/// channel), weighted by length. `mesh`: with runs, vertices shared. Only points around which both
/// pictures vary by at most `most_contrast` of 255 count: 255 takes all, 12 only plain surface,
/// where a difference is not due to texture or occlusion. 0 if there is no such point.
double seam_color_step(const Mesh& mesh, std::span<const View> views, const Pictures& pictures,
                       const Gains& gains, int most_contrast = 255);

}  // namespace mr::atlas
