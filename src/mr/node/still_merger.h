#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "mr/atlas/color_sampler.h"
#include "mr/atlas/labels.h"
#include "mr/atlas/lasting_labels.h"
#include "mr/atlas/occluders.h"
#include "mr/calib/depth_correction.h"
#include "mr/core/decoded_scene.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/core/trace.h"
#include "mr/core/view.h"
#include "mr/kit/part.h"
#include "mr/merge/overlap/free_space_carver.h"
#include "mr/merge/overlap/still_surface_mask.h"
#include "mr/node/cube_merger.h"
#include "mr/node/surface_joiner.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// The still surface as shown, with the structures that every tick queries. Immutable.
struct ShownStill {
  std::shared_ptr<const Mesh> mesh;  ///< labelled, on the lattice
  float error_m = 0;
  // Root only:
  std::shared_ptr<const merge::StillSurfaceMask> cover;  ///< removes moving surface that coincides
  std::shared_ptr<const atlas::Occluders> occluders;  ///< in view selection for the moving surface
};

/// The configuration of view selection for a surface with this geometric error and these sensors'
/// noise.
atlas::LabelConfig label_config(const Scene& scene, const std::vector<SourceInfo>& sources,
                                float error_m);

/// Merges the still surfaces of all inputs into one (docs/layers.md, The merger): incrementally,
/// around the changed cubes, without surface that was carried away, and at the root textured by
/// plates. It counts ticks and never reads a clock. Not thread-safe: it may run on another thread
/// than its owner's, which must not call it meanwhile.
class StillMerger {
 public:
  /// The still surfaces of all inputs.
  struct Inputs {
    std::vector<DecodedScene> scenes;  ///< the still layer, without textures
    std::vector<kit::Part> parts;      ///< the same, corrected
    calib::Bends bends;                ///< by which they were; one per part
  };
  /// The arguments of an update.
  struct Task {
    std::uint64_t sequence = 0;    ///< the tick
    std::optional<Inputs> inputs;  ///< none: unchanged
    Decimation decimation = {};    ///< of these inputs
    std::vector<View> views;       ///< as the inputs have them, poses corrected
    std::vector<SourceInfo> sources;
    std::map<ViewId, TileMask> valid;  ///< valid blocks of plates
    std::size_t valid_blocks = 0;      ///< their number
    atlas::PictureSampler colors;      ///< the plates
    merge::FreeSpaceCarver empty;      ///< removes surface in free space
  };
  /// The result of an update.
  struct Made {
    ShownStill shown;
    std::map<Vec3i, SurfacePiece> pieces;  ///< the shown mesh by the cubes that it is sent in
    bool is_whole = true;  ///< false: a part is withheld until an update of a later tick
  };

  /// The scene, the merger and the trace must outlive this.
  StillMerger(const Scene& scene, const MergerConfig& merger, bool is_root, Clock clock,
              Trace& trace);

  /// Edge of the cubes in which the shown mesh is sent.
  static double piece_m(const Scene& scene, bool is_root);

  /// Whether an update is due although no input changed. `emptied_m2`: area of the surface whose
  /// place became free space, or ceased to be, since the last update.
  bool is_due(std::uint64_t sequence, std::size_t valid_blocks, double emptied_m2) const;

  /// After an Error the same task may be given again.
  Result<Made> update(Task task);

  /// Whether some of the pieces were not sent because only a few of their labels had changed.
  void note_outdated(bool any) { labels_.are_outdated = any; }

 private:
  /// The state of view selection.
  struct Labels {
    atlas::LastingLabels lasting;
    bool are_any = false;
    bool are_outdated = false;  ///< some were not sent
    bool is_check_due = false;  ///< surface was removed; what it uncovered is not labelled yet
    // Ticks: of the first labelling; of the last one of everything; of the last one that included
    // uncovered surface; of the last one of any kind.
    std::uint64_t first = 0, all = 0, checked = 0, last = 0;
    std::size_t blocks = 0, blocks_at_all = 0;  // valid ones of plates, at `last` and at `all`
    std::size_t pieces = 0, pieces_at_all = 0;  // triangles, at `last` and at `all`
  };
  struct Joined {
    Mesh mesh;  // not labelled yet
    std::vector<kit::Part> parts;
    CubeErrors errors;
    merge::GuessedSurface guessed;
  };

  std::map<Vec3i, SurfacePiece> pieces() const;
  Status join(Inputs inputs, const Decimation& decimation, std::uint64_t sequence);
  void note_fresh(const std::vector<DecodedScene>& scenes, std::uint64_t sequence);
  std::optional<std::uint64_t> fresh_until(Vec3i cube, std::uint64_t sequence) const;
  atlas::LastingLabels::Extent extent_of(const Task& task) const;
  Mesh labelled(const Task& task, atlas::LastingLabels::Extent extent);
  Mesh without_fresh_grey(const Mesh& mesh, std::uint64_t sequence,
                          std::optional<std::uint64_t>& until) const;
  bool is_labelling_worth_it(std::uint64_t age, std::size_t valid_blocks) const;

  const Scene* scene_;
  bool is_root_;
  Trace* trace_;
  SurfaceJoiner joiner_;
  CubeMerger cubes_;
  calib::Bends bends_;  ///< of the parts that cubes_ knows
  Joined joined_;
  Labels labels_;
  ShownStill shown_;
  bool is_labelled_ = false;                     ///< joined_ was labelled
  std::optional<std::uint64_t> withheld_until_;  ///< tick; nothing: nothing is withheld
  std::map<Vec3i, std::vector<ChunkKey>> contents_;
  std::map<Vec3i, std::uint64_t> fresh_since_;  ///< tick of a cube's last change
};

}  // namespace mr::node
