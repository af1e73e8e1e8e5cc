#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mr/atlas/label_history.h"
#include "mr/atlas/labels.h"
#include "mr/atlas/occluders.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/view.h"
#include "mr/kit/pair_map.h"

namespace mr::atlas {

/// Incremental view selection for a surface that changes only in places: unchanged triangles keep
/// their labels and splits, to the vertex. A triangle is labelled again if
///  - it is new,
///  - the depth in its view has changed there, or the view is not valid there any more,
///  - it had no view, and in some view the depth has changed there or has become valid there,
///  - it belongs to a region that is too small (LabelConfig::least_region_m2), beside such
///  triangles.
/// A triangle that is labelled again keeps the view that was at its place (LabelHistory) unless
/// another one is clearly better. So the cost is proportional to the changes, and unchanged chunks
/// are sent only once. If any view is not a pinhole, everything is labelled each time.
class LastingLabels {
 public:
  /// What update() labels again: everything, as label_triangles() does; all changes; or, faster,
  /// only new triangles and changes of the views' masks, so that new occlusions are found at the
  /// next update.
  enum class Extent { everything, changes, new_surface };

  /// Returns the surface with runs. `surface` is welded. `config.occluders` and `config.history`
  /// are not used; `config.valid` is of tiles of 16 pixels. Deterministic, and the same on any
  /// number of threads.
  Mesh update(const Mesh& surface, std::span<const View> views, LabelConfig config, Extent extent);

  /// Depth maps of the last surface from its views (Extent::new_surface: of the one before).
  /// Immutable. Null before the first.
  std::shared_ptr<const Occluders> occluders() const { return occluders_; }
  /// Whether the last two surfaces and their views were equal, so that only labels and splits may
  /// differ.
  bool kept_surface() const { return kept_surface_; }

 private:
  /// Tiles of a view's picture that changed.
  struct Changes {
    TileMask other;   ///< depth changed, or not valid any more
    TileMask better;  ///< the same, or has become valid
  };

  bool may_keep(std::span<const View> views) const;
  bool is_last_surface(const Mesh& surface) const;
  std::optional<std::uint32_t> last_place(const Mesh& surface, std::size_t t,
                                          std::uint64_t key) const;
  Labelling carry_over(const Mesh& surface, std::span<const std::uint64_t> keys) const;
  std::vector<Changes> changes(std::span<const View> views, const Occluders& now,
                               const std::map<ViewId, TileMask>& valid) const;
  void remember(const Mesh& surface, std::span<const std::uint64_t> keys,
                std::span<const View> views);

  std::vector<View> views_;
  Labelling last_;
  Mesh labelled_;                           ///< the last result
  std::vector<Triangle> triangles_;         ///< [T] of the last surface
  std::vector<std::uint32_t> first_piece_;  ///< [T + 1] in `last_`
  kit::PairMap place_{0};                   ///< index of a triangle, by the hash of its corners
  std::shared_ptr<const Occluders> occluders_;
  std::map<ViewId, TileMask> valid_;
  bool kept_surface_ = false;
  bool occluders_are_old_ = false;  ///< of a surface before the last
};

}  // namespace mr::atlas
