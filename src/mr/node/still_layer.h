#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "mr/core/coding_plan.h"
#include "mr/core/decoded_scene.h"
#include "mr/core/result.h"
#include "mr/core/trace.h"
#include "mr/kit/part.h"
#include "mr/merge/overlap/free_space_carver.h"
#include "mr/node/chunk_publisher.h"
#include "mr/node/layers.h"
#include "mr/node/root_atlas.h"
#include "mr/node/side_job.h"
#include "mr/node/still_merger.h"
#include "mr/node/still_receipts.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// The still surface of a merger, tick by tick (docs/layers.md, The merger): merged where an input
/// changed, labelled anew when there are better plates, published, and acknowledged to the inputs.
/// Where StillWork allows, the work goes on beside the ticks once most of the room is learnt.
class StillLayer {
 public:
  /// All must outlive this. `atlas`: has the plates; the root's.
  StillLayer(const Scene& scene, const MergerConfig& merger, bool is_root, Clock clock,
             StillWork work, Trace& trace, ChunkPublisher& publisher, RootAtlas& atlas);

  /// Whether any input has sent still surface so far.
  bool exists() const { return scenes_.has_value(); }
  /// Whether `scenes`, the still layer of the inputs, is another than what was merged last.
  bool is_outdated(const std::vector<DecodedScene>& scenes, const Decimation& decimation) const;

  /// Publishes what the work beside the ticks has made, if that is done.
  Status publish_finished(std::uint64_t sequence);

  /// What is to be merged of the inputs' scenes; nothing while the work goes on.
  std::optional<StillMerger::Inputs> take_inputs(std::vector<DecodedScene> scenes,
                                                 const Decimation& decimation);

  struct Tick {
    std::uint64_t sequence = 0;
    Decimation decimation;
    const CorrectedPoses& poses;
    std::size_t moving_triangles = 0;
  };
  /// Merges `inputs`, where there are any, and sees to labels and to what was carried away.
  Status update(std::optional<StillMerger::Inputs> inputs, const Tick& tick);

  /// Takes from the parts of the moving surface what the still one shows. Where that waits to be
  /// sent, the moving surface stays.
  void remove_shown(std::vector<kit::Part>& moving) const;

  const ShownStill& shown() const { return shown_; }
  StillReceipts& receipts() { return receipts_; }

 private:
  /// What an update came to.
  struct Update {
    Result<StillMerger::Made> made;
    std::optional<StillReceipts::Sequences> inputs;  ///< whose still surfaces are merged anew
  };

  Status publish(Update update, std::uint64_t sequence);
  bool is_mostly_learnt(std::size_t moving_triangles) const;

  bool is_root_;
  double piece_m_;  ///< edge of the cubes in which the surface is sent
  StillWork work_;
  ChunkPublisher* publisher_;
  RootAtlas* atlas_;
  StillMerger merger_;
  StillReceipts receipts_;
  std::optional<std::vector<DecodedScene>> scenes_;  ///< that are merged; none so far
  Decimation decimation_;                            ///< of these
  ShownStill shown_;                                 ///< no mesh: there is none yet
  merge::FreeSpaceCarver carver_;
  double carved_m2_ = 0;  ///< since the last update was begun
  SideJob<Update> job_;   ///< last: it uses what is above
};

}  // namespace mr::node
