#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <vector>

#include "mr/atlas/clean_plate.h"
#include "mr/core/frame.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/core/trace.h"
#include "mr/node/side_job.h"
#include "mr/node/still_surface.h"
#include "mr/scene/scene.h"
#include "mr/sensor/registration.h"
#include "mr/still/background.h"
#include "mr/still/outline.h"

namespace mr::node {

/// What a sensor that stands still knows of the room (docs/layers.md): a background model parts
/// each depth picture into what moves and what stays; of what stays a still surface is
/// reconstructed, of which only chunks that changed are sent. note_sent() and note_shown() may be
/// called on any thread, all others on one.
class SensorLayers {
 public:
  /// All must outlive this.
  SensorLayers(const Scene& scene, SensorId id, const sensor::Registration& registration,
               StillWork work, Trace& trace);

  /// Learns the room from an undistorted frame that is not reconstructed.
  void learn(const Frame& frame) { observe(frame, 0); }
  /// Whether most of the room is still to be learnt.
  bool is_new() const { return background_.is_new(); }

  /// What was learnt, for measuring: to measure again from the same state, or by another sensor
  /// node of the same sensor.
  struct Memory {
    still::Background background;
    atlas::CleanPlate plate;
  };
  Memory memory() const { return {background_, plate_}; }
  void recall(Memory memory);

  struct Divided {
    ImageDepth moving;        ///< cleaned
    ImageMask moving_pixels;  ///< before cleaning
    /// `moving` with the outline that the colour picture shows. Without alpha: the picture has no
    /// say, and the depth is that of `moving`.
    still::Outline outline;
    TileMask confirmed_depth, confirmed_color;
  };
  /// Parts an undistorted frame, and brings the still surface up to date.
  /// `still_error_m`: to which that is decimated.
  Result<Divided> divide(const Frame& frame, double still_error_m);

  /// How many chunks the still surface has.
  std::size_t chunks() const { return chunks_; }

  struct News {
    std::vector<StillChunk> chunks;  ///< of the still surface, that changed
    bool began_anew = false;  ///< the camera was pushed: what was known does not hold any more
  };
  /// What the next packets are to bring; once.
  News take_news();
  /// The packet with that sequence brings the last chunks of the oldest take_news() of which some
  /// were not sent.
  void note_sent(std::uint64_t sequence);
  /// The merger shows the still surface as that packet had it.
  void note_shown(std::uint64_t sequence);

 private:
  using Chunks = Result<std::vector<StillChunk>>;

  still::BackgroundUpdate observe(const Frame& frame, std::uint32_t shown);
  std::uint32_t shown_changes();
  still::Outline find_outline(const Frame& frame, const Divided& divided, const ImageMask& foreign);
  ImageDepth clean_where(const ImageMask& mask, const Camera& camera, const Frame& frame) const;
  Chunks reconstruct(const Frame& still, int readings, double error_m);
  Status accept(Chunks made);
  Status update_surface(const Frame& frame, double error_m);

  const Scene* scene_;
  const SensorConfig* sensor_;
  const sensor::Registration* registration_;
  StillWork work_;
  Trace* trace_;
  still::Background background_;
  std::optional<still::OutlineFinder> outline_;  ///< of pinhole cameras
  atlas::CleanPlate plate_;                      ///< by which the outline is found
  StillSurface surface_;                         ///< the job's, while that is busy
  std::size_t chunks_ = 0;                       ///< of the surface
  std::vector<StillChunk> unsent_;               ///< changed, and no packet was begun with them
  bool is_outdated_ = false;  ///< the still picture changed since chunks were last begun
  double error_m_ = 0;        ///< to which these are decimated
  bool began_anew_ = false;   ///< and nobody was told yet
  int waited_ = 0;            ///< captures, for word that the newest chunks are shown
  // Changes of the still picture, as the background counts them:
  std::uint32_t begun_ = 0;               ///< of which the surface is being reconstructed
  std::uint32_t made_ = 0;                ///< of which it was
  std::mutex sent_mutex_;                 ///< guards what is below
  std::deque<std::uint32_t> on_the_way_;  ///< taken, and not all sent yet
  std::deque<std::pair<std::uint64_t, std::uint32_t>> sent_;  ///< by packets, which are not shown
  std::uint32_t shown_ = 0;
  SideJob<Chunks> job_;  ///< last: it uses what is above
};

}  // namespace mr::node
