#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <unordered_map>
#include <vector>

#include "mr/atlas/labels.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/view.h"

namespace mr::atlas {

/// The labels of a surface that stays and is changed here and there: what did not change keeps its
/// labels and cuts, vertex by vertex. A triangle is labelled anew where
///  - it was not part of the surface before,
///  - its view sees other surface there than before, or is good for it no more,
///  - it had no view, and some view sees other surface there, or has become good for it.
/// So labels cost what changed, and chunks without changes are sent once. Where a view is no
/// pinhole, all is labelled each time.
class LastingLabels {
 public:
  /// The surface with runs; vertices that cutting added may lie off the lattice. `surface` is
  /// welded. `config.occluders` is not used; `config.valid` is of
  /// tiles of 16 pixels. `all`: label everything, as label_triangles() does.
  /// Deterministic, and the same on any number of threads.
  Mesh update(const Mesh& surface, std::span<const View> views, LabelConfig config, bool all);

  /// The depth of the last surface as its views see it.
  const Occluders& occluders() const { return occluders_; }

 private:
  /// The corners of a triangle, the smallest first; the winding stays.
  using Corners = std::array<Vec3f, 3>;
  struct CornersHash {
    std::size_t operator()(const Corners& corners) const;
  };
  /// Tiles of a view's picture where something is another than before.
  struct Changes {
    TileMask other;   ///< it sees other surface, or is not valid any more
    TileMask better;  ///< those, and where it has become valid
  };

  bool may_keep(std::span<const View> views) const;
  Labelling carry_over(const Mesh& surface) const;
  std::vector<Changes> changes(std::span<const View> views, const Occluders& now,
                               const std::map<ViewId, TileMask>& valid) const;
  void remember(const Mesh& surface, std::span<const View> views);

  std::vector<View> views_;
  Labelling last_;
  std::vector<Triangle> triangles_;         ///< [T] of the last surface
  std::vector<std::uint32_t> first_piece_;  ///< [T + 1] in `last_`
  std::unordered_map<Corners, std::uint32_t, CornersHash>
      place_;  ///< of a triangle, by its corners
  Occluders occluders_;
  std::map<ViewId, TileMask> valid_;
};

}  // namespace mr::atlas
