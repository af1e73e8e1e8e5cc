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

/// [channel][value] what a view's byte becomes: sRGB to linear light, times the gain, back to sRGB,
/// clipped at white. A gain of 1 leaves every byte as it is.
using GainTables = std::array<std::array<std::uint8_t, 256>, 3>;
GainTables gain_tables(Vec3f gain);

/// Gain and white balance of each view, estimated where several views see the same surface, so that
/// a seam across a plain wall does not show. The mean over all views that overlap stays as it is
/// (of the logarithms). Smoothed over time; deterministic.
class ColorBalance {
 public:
  /// Takes a frame's evidence. `mesh`: the merged surface; `views` as the children have them, each
  /// with the stream whose picture shows it; both in metres of one world. Cheap: a few thousand
  /// samples. A view that appears has its gain at once; after that gains follow within about
  /// 30 calls, and stand still, to the bit, while the evidence differs by less than 0.6 %.
  void update(const Mesh& mesh, std::span<const View> views, const Pictures& pictures);

  /// One per view of the last update(); 1 where nothing overlaps. Within [1/3, 3].
  const Gains& gains() const { return gains_; }

  /// The logarithm of a view's gain in one channel, over time.
  struct Channel {
    double smoothed = 0, used = 0;
    bool moving = false;  ///< `used` follows `smoothed` until that has arrived

    void start(double wanted);
    void follow(double wanted);
  };
  using Balance = std::array<Channel, 3>;

 private:
  std::map<ViewId, Balance> balances_;
  Gains gains_;
};

/// The mean step of colour across seams: over the edges of the mesh at which the view changes, the
/// mean distance (of 255, sRGB, largest channel) between what the two views show at points of the
/// edge, by length. `mesh`: with runs, vertices shared. Only points count around which neither
/// picture varies by more than `most_contrast` of 255: 255 takes all, 12 what is plain, where a
/// step is not one of texture or of what lies behind an edge. 0 without such a point. For
/// measuring.
double seam_color_step(const Mesh& mesh, std::span<const View> views, const Pictures& pictures,
                       const Gains& gains, int most_contrast = 255);

}  // namespace mr::atlas
