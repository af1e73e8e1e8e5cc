#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "mr/atlas/labels.h"
#include "mr/atlas/lasting_labels.h"
#include "mr/atlas/occluders.h"
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

/// A still surface as it is shown, with what is asked about it at every tick. Never changed.
struct ShownStill {
  std::shared_ptr<const Mesh> mesh;  ///< labelled, on the lattice
  float error_m = 0;
  // The root's alone:
  std::shared_ptr<const merge::StillSurfaceMask> cover;  ///< takes from what moves what is shown
  std::shared_ptr<const atlas::Occluders> occluders;     ///< hides what moves
};

/// What the labels of a surface follow from: how large its errors are, and the sensors' noise.
atlas::LabelConfig label_config(const Scene& scene, const std::vector<SourceInfo>& sources,
                                float error_m);

/// Makes one still surface of all inputs' (docs/layers.md, The merger): merged around what
/// changed, without what was carried away, and at the root textured by plates. It counts ticks and
/// never looks at a clock. Not thread-safe: it may work on another thread than its owner's, who
/// asks nothing meanwhile.
class StillMerger {
 public:
  /// The surfaces of all inputs.
  struct Inputs {
    std::vector<DecodedScene> scenes;  ///< the still layer, without textures
    std::vector<kit::Part> parts;      ///< the same, poses corrected
  };
  /// What an update follows from.
  struct Task {
    std::uint64_t sequence = 0;    ///< the tick
    std::optional<Inputs> inputs;  ///< none: they are what they were
    Decimation decimation = {};    ///< of these inputs
    std::vector<View> views;       ///< as the inputs have them, poses corrected
    std::vector<SourceInfo> sources;
    std::map<ViewId, TileMask> valid;  ///< blocks of plates
    std::size_t valid_blocks = 0;      ///< how many
    merge::FreeSpaceCarver empty;      ///< places from which things were carried away
  };
  /// What came of it.
  struct Made {
    ShownStill shown;
    std::map<Vec3i, Mesh> pieces;  ///< the shown mesh by the cubes that it is sent in
    bool is_whole = true;  ///< nothing of it is withheld: an update of a later tick shows it
  };

  /// The scene, the merger and the trace must outlive this.
  StillMerger(const Scene& scene, const MergerConfig& merger, bool is_root, Clock clock,
              Trace& trace);

  /// Whether labels should be chosen anew though no input changed. `emptied_m2`: area of places
  /// that became empty, or are no longer, since the last update.
  bool is_due(std::uint64_t sequence, std::size_t valid_blocks, double emptied_m2) const;

  /// After an Error the same inputs may be given again.
  Result<Made> update(Task task);

  /// Some of the pieces were not sent: nothing but a few labels in them was other.
  void note_outdated(bool any) { labels_.are_outdated = any; }

 private:
  /// How the surface got its labels.
  struct Labels {
    atlas::LastingLabels lasting;
    bool are_any = false;
    bool are_outdated = false;  ///< some were not sent
    bool is_look_due = false;   ///< something went, and what that uncovers waits
    // Sequence: at first; all of it; what is uncovered, too; some of it.
    std::uint64_t first = 0, all = 0, looked = 0, last = 0;
    std::size_t blocks = 0, blocks_at_all = 0;  // of plates, then
    std::size_t pieces = 0, pieces_at_all = 0;  // triangles
  };
  struct Joined {
    Mesh mesh;  // not labelled yet
    std::vector<kit::Part> parts;
    float error_m = 0;
  };

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
  Joined joined_;
  Labels labels_;
  ShownStill shown_;
  bool is_labelled_ = false;                     ///< what was joined last
  std::optional<std::uint64_t> withheld_until_;  ///< sequence; nothing: all is shown
  std::map<Vec3i, std::vector<ChunkKey>> contents_;
  std::map<Vec3i, std::uint64_t> fresh_since_;  ///< sequence since which a cube is another
};

}  // namespace mr::node
