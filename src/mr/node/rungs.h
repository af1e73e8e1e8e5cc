#pragma once

#include <cstddef>
#include <cstdint>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mr/codec/control.h"
#include "mr/core/packet.h"
#include "mr/node/merge_node.h"
#include "mr/node/side_job.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// The names of the streams that a scene's root can send beside its own, for viewers that want
/// less: "root~1", … Empty: rate control is off, or the scene wants one stream.
std::vector<std::string> rung_names(const Scene& scene);

/// The root's stream at lower rates (docs/rate-control.md, Rungs): each rung is a root of its own
/// for the same captures, with its own rate control. It begins when somebody wants it, rests when
/// nobody has for kPatience, and is gone after kKept. Sensors follow the plan of the root's own
/// stream, which has the highest rate. In the mean, rungs together take no more time than that
/// stream: where there is none left, they leave captures out. A rung's first capture makes the
/// whole still surface, in the background where still surface is made there.
class Rungs {
 public:
  static constexpr Duration kPatience = std::chrono::seconds(3), kKept = std::chrono::seconds(60);

  struct Options {
    NodeClock clock = {};
    StillWork still_work = StillWork::at_once;
    std::shared_ptr<const rate::Model> model = {};  ///< not null
    std::vector<EncodedChunk> background = {};
  };
  /// The scene must outlive this.
  Rungs(const Scene& scene, const MergerConfig& root, Options options);

  const std::vector<std::string>& names() const { return names_; }

  ~Rungs();
  /// As MergeNode::answer(). A wanted rate is what makes a rung exist. Any thread.
  std::vector<std::byte> answer(std::size_t rung, const codec::Control& request, TimePoint now);

  using Packets = std::vector<std::pair<std::size_t, std::vector<std::byte>>>;  ///< by rung
  /// Why a rung has no packet of a capture; over_budget: it was left out, for its rate or for time.
  struct Missing {
    std::size_t rung;
    Error why;
  };
  /// The packets of a capture that `top`, the root, has merged, which took it `took`.
  Packets merge(const CaptureSet& captures, const MergeNode& top, Duration took, TimePoint now,
                std::vector<Missing>& missing);

 private:
  struct Rung {
    std::shared_ptr<MergeNode> node;  ///< null: nobody wants it
    std::optional<double> wanted_mbps;
    TimePoint wanted_at{};
  };
  using Bytes = Result<std::vector<std::byte>>;
  std::shared_ptr<MergeNode> wanted(std::size_t rung, const CaptureSet& captures,
                                    const MergeNode& top, TimePoint now);
  std::shared_ptr<MergeNode> start(std::size_t rung, const CaptureSet& captures,
                                   const MergeNode& top);
  void end(std::shared_ptr<MergeNode> node);

  const Scene* scene_;
  MergerConfig root_;
  Options options_;
  std::vector<std::string> names_;
  std::mutex mutex_;
  std::vector<Rung> rungs_;   ///< as names_; guarded by mutex_
  std::uint32_t starts_ = 0;  ///< of rungs; merge()'s thread, as all below
  std::size_t first_ = 0;     ///< whose turn it is
  Duration time_left_{};
  std::vector<SideJob<Bytes>> beginnings_;  ///< as names_: first captures, in the background
  std::future<void> ended_;                 ///< of the last node
};

}  // namespace mr::node
