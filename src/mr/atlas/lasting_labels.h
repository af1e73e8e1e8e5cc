#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mr/atlas/labels.h"
#include "mr/atlas/occluders.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/view.h"
#include "mr/kit/pair_map.h"

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
  /// What is looked at: everything, as label_triangles() does; what is not as it was; or of that
  /// only what is new to the surface and what its views' masks changed, quickly: what it hides or
  /// uncovers is seen the next time.
  enum class Extent { everything, changes, new_surface };

  /// The surface with runs; vertices that cutting added may lie off the lattice. `surface` is
  /// welded. `config.occluders` is not used; `config.valid` is of tiles of 16 pixels.
  /// Deterministic, and the same on any number of threads.
  Mesh update(const Mesh& surface, std::span<const View> views, LabelConfig config, Extent extent);

  /// The depth of the last surface as its views see it (Extent::new_surface: of the one before);
  /// never changed. Null before the first.
  std::shared_ptr<const Occluders> occluders() const { return occluders_; }
  /// Whether the last surface was the same as the one before, from the same views: only labels and
  /// cuts may be others.
  bool kept_surface() const { return kept_surface_; }

 private:
  /// Tiles of a view's picture where something is another than before.
  struct Changes {
    TileMask other;   ///< it sees other surface, or is not valid any more
    TileMask better;  ///< those, and where it has become valid
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
  std::vector<Triangle> triangles_;         ///< [T] of the last surface
  std::vector<std::uint32_t> first_piece_;  ///< [T + 1] in `last_`
  kit::PairMap place_{0};                   ///< of a triangle, by the hash of its corners
  std::shared_ptr<const Occluders> occluders_;
  std::map<ViewId, TileMask> valid_;
  bool kept_surface_ = false;
  bool occluders_are_old_ = false;  ///< of a surface before the last
};

}  // namespace mr::atlas
