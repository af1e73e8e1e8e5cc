#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "mr/atlas/clean_plate.h"
#include "mr/atlas/color_balance.h"
#include "mr/atlas/color_field.h"
#include "mr/atlas/view_blend.h"
#include "mr/core/mesh.h"
#include "mr/core/view.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// What is known about the colour of a sensor's camera, for reports.
struct CameraColor {
  std::string sensor;
  Vec3f gain{1, 1, 1};  ///< by which its linear light is multiplied, mean over the picture
  double misfit = 0;    ///< atlas::ViewFit::misfit: how far it is from the others after correction
  std::string note;     ///< what looks wrong with it; empty: nothing
};

/// When and from which pictures the root estimates how colours are corrected (atlas/color_balance),
/// and what follows from the cameras' automatic exposure. Where there are plates, they are the
/// pictures of the still surface, at one exposure, and estimates are made when the plates changed;
/// else the live pictures, regularly.
class RootColors {
 public:
  using Plates = std::map<ViewId, atlas::CleanPlate>;

  /// One tick. `live`: the newest pictures; `seeing`: the tiles of them that may give colour (of a
  /// view without a mask, all); `still`: the still surface with `plates`, or null.
  struct Tick {
    const std::vector<View>& views;
    const atlas::Pictures& live;
    const atlas::ValidTiles& seeing;
    const Mesh& moving;
    const Mesh* still;
    const Plates& plates;
    std::size_t changed_blocks;  ///< of the plates, in this tick
  };

  /// `corrects`: whether views are corrected at all; exposure is always evened out.
  explicit RootColors(bool corrects = true) : corrects_(corrects) {}

  void update(const Tick& tick);

  /// Of the live pictures, in front of the plates. The plates' own have no exposure.
  atlas::ColorCorrections live() const;
  atlas::ColorCorrections plates() const;
  /// The factor on the sRGB values of all plates that gives the newest captures' exposure as far as
  /// it is common to all cameras: a change of the light in the room, not of one camera.
  Vec3f exposure() const { return exposure_; }
  /// How views are blended: where pictures lie on each other, each keeps its detail and the best
  /// counts most; where they do not, wrong detail is averaged.
  atlas::BlendConfig blending() const { return {sharpness_, sharpness_ >= kSharpest}; }
  /// How far pictures lie beside each other on the surface.
  double misplaced_px() const { return balance_.misplaced_px(); }
  /// The cameras that see what others see, by view.
  std::vector<CameraColor> findings(const Scene& scene) const;

 private:
  static constexpr double kSharpest = 4;

  bool is_due(const Tick& tick) const;
  void estimate(const Tick& tick);
  void sharpen(double misplaced_px);
  void follow_exposure(const Plates& plates);

  bool corrects_;
  atlas::ColorBalance balance_;
  std::map<ViewId, Vec3f> log_exposure_;  ///< from a view's live picture to the common exposure
  Vec3f exposure_{1, 1, 1};
  double sharpness_ = kSharpest;
  // The last estimate.
  std::set<ViewId> views_;
  bool of_plates_ = false;
  int ticks_ = 0;            ///< since
  std::size_t changed_ = 0;  ///< blocks of plates, since
};

}  // namespace mr::node
