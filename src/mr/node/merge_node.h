#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "mr/atlas/labels.h"
#include "mr/atlas/lasting_labels.h"
#include "mr/codec/head.h"
#include "mr/core/result.h"
#include "mr/core/scene.h"
#include "mr/core/trace.h"
#include "mr/merge/coincidence.h"
#include "mr/merge/emptiness.h"
#include "mr/merge/part.h"
#include "mr/merge/quality_grid.h"
#include "mr/node/calibration_check.h"
#include "mr/node/chunk_publisher.h"
#include "mr/node/cube_merger.h"
#include "mr/node/gatherer.h"
#include "mr/node/node_clock.h"
#include "mr/node/root_atlas.h"
#include "mr/simplify/simplify.h"

namespace mr::node {

/// A merging server (paper 3.2, 3.3). Takes packets of sensors or of other mergers, and gives
/// packets of the same form: one surface without overlap, seams closed, every triangle labelled
/// with a view. The root decimates and composes one texture atlas; an inner merger hands its
/// children's texture streams on untouched, so that pictures are coded twice at most however many
/// layers there are. inputs() and merge() may be used by two threads, so that one tick is received
/// while another is merged; answer() by any.
class MergeNode {
 public:
  /// The scene must outlive the node.
  MergeNode(const Scene& scene, const MergerConfig& merger, bool is_root, NodeClock clock = {});

  /// Chunks of the scene's background model, for the root. Before the first merge().
  void set_background(std::vector<EncodedChunk> chunks) {
    publisher_.add_background(std::move(chunks));
  }

  const std::string& id() const { return merger_.id; }
  const MergerConfig& config() const { return merger_; }

  Gatherer& inputs() { return gatherer_; }
  const Gatherer& inputs() const { return gatherer_; }

  /// The bytes of the merged packet. After an Error the inputs should send key frames, as units
  /// that were to be handed on are lost. `halfway` is called when the stages that use every core
  /// are over: on one machine, the inputs' next frames fit in from there.
  Result<std::vector<std::byte>> merge(const Gathered& gathered,
                                       const std::function<void()>& halfway = {});

  /// Chunks that a receiver asked for; empty when there are none. Wishes for key frames and for a
  /// whole head are noted.
  std::vector<std::byte> answer(const codec::Request& request);
  /// null when it is not live any more. Any thread.
  std::shared_ptr<const EncodedChunk> find(const ChunkKey& key) const {
    return publisher_.find(key);
  }
  /// Streams of which key frames were asked for that the inputs have to give. Forgets them.
  std::vector<std::uint32_t> take_key_frame_wishes();

  /// The newest merged surface, before coding: what moves, then what stays. Nothing before the
  /// first.
  std::optional<Mesh> surface() const;
  /// Whether the last merge found the inputs' geometry unchanged and kept its surface.
  bool reused() const { return reused_; }

  /// Called in merge() of the root, before its pictures are drawn; for measuring.
  using DrawingListener = std::function<void(const RootAtlas::Drawing& drawing)>;
  void set_drawing_listener(DrawingListener listener) { drawing_listener_ = std::move(listener); }

  /// How much of the still surface the last merge of it had to look at.
  const CubeMerger& cubes() const { return cubes_; }

  /// How well the inputs fit, and a line when one does not.
  CalibrationCheck& calibration() { return calibration_; }

  Trace& trace() { return trace_; }
  const Trace& trace() const { return trace_; }

 private:
  /// A merged surface, and what it was made from.
  struct Surface {
    std::vector<DecodedScene> scenes;  // one layer, without textures
    Mesh mesh;                         // labelled, on the lattice
    float error_m = 0;
  };
  using Parts = std::vector<merge::Part>;
  /// The still surface, with what it is labelled from and what the moving one is compared with.
  struct Still : Surface {
    Mesh joined;  // not labelled yet
    Parts parts;
    merge::StillCover cover;
    bool is_labelled = false;
    double emptied_m2 = 0;                        // since it was labelled
    std::optional<std::uint64_t> withheld_until;  // sequence; nothing: all is shown
  };
  /// How the still surface got its labels.
  struct Labels {
    atlas::LastingLabels lasting;
    bool are_any = false;
    bool are_outdated = false;                   ///< some were not sent
    std::uint64_t first = 0, all = 0, last = 0;  // sequence: at first, all of it, some of it
    std::size_t blocks = 0, blocks_at_all = 0;   // of plates, then
    std::size_t pieces = 0, pieces_at_all = 0;   // triangles
  };
  /// Views and sources as merge.refine corrected them.
  struct Places {
    std::vector<View> views;
    std::vector<SourceInfo> sources;
  };

  /// What joining one of the surfaces remembers.
  struct Joining {
    merge::QualityMemory quality;
    double triangles = 0;  ///< that the children spent on what is left, when all was joined last
  };

  merge::OverlapConfig overlap_config() const;
  Packet head(const Gathered& gathered) const;
  Status merge_surfaces(const Gathered& gathered, const std::function<void()>& halfway);
  void correct(const Gathered& gathered, bool look, Parts& parts);
  Status merge_still(const Gathered& gathered, std::vector<DecodedScene> scenes);
  void note_fresh(const std::vector<DecodedScene>& scenes);
  void look_at_plates(const Gathered& gathered, const Parts& moving);
  bool is_labelling_worth_it(std::uint64_t age) const;
  Status label_still();
  std::optional<std::uint64_t> fresh_until(Vec3i cube) const;
  Mesh without_fresh_grey(const Mesh& mesh, const Mesh& shown,
                          std::optional<std::uint64_t>& until) const;
  Status merge_moving(std::vector<DecodedScene> scenes, const Parts& parts,
                      const std::function<void()>& halfway);
  Mesh join(const Parts& parts, bool all, Joining& joining, const std::function<void()>& halfway);
  Result<Mesh> decimated(const Mesh& mesh, const Joining& joining, float& error_m);
  atlas::LabelConfig label_config(float error_m) const;
  Mesh label_moving(const Mesh& mesh, float error_m) const;
  Mesh labelled_still();
  Result<Mesh> on_lattice(const Mesh& mesh) const;
  Status add_textures(const Gathered& gathered, Packet& packet);
  void add_marks(const Gathered& gathered, TimePoint started, Packet& packet) const;

  const Scene* scene_;
  MergerConfig merger_;
  bool is_root_;
  NodeClock clock_;
  Gatherer gatherer_;
  ChunkPublisher publisher_;
  RootAtlas atlas_;
  codec::HeadWriter writer_;
  simplify::Simplifier simplifier_;
  CalibrationCheck calibration_;
  Joining still_joining_, moving_joining_;
  CubeMerger cubes_;  ///< of the still surface
  merge::EmptyPlaces empty_;
  Labels labels_;
  std::optional<Still> still_;     ///< none: no input has a still surface
  std::optional<Surface> moving_;  ///< reused while the inputs' geometry stays
  std::map<Vec3i, std::vector<ChunkKey>> still_contents_;
  std::map<Vec3i, std::uint64_t> fresh_since_;  ///< sequence since which a still cube is another
  Places places_;
  std::atomic<bool> reused_ = false;
  std::mutex wishes_mutex_;
  std::set<std::uint32_t> key_frame_wishes_;
  std::uint64_t sequence_ = 0;
  DrawingListener drawing_listener_;
  double zipper_ms_ = 0;  ///< what closing all gaps took last; for merger.budget_ms
  bool hurried_ = false;  ///< some gaps were left open
  Trace trace_;
};

}  // namespace mr::node
