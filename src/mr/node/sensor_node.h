#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mr/codec/control.h"
#include "mr/codec/head.h"
#include "mr/core/frame.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/core/trace.h"
#include "mr/fusion/fuse.h"
#include "mr/node/chunk_publisher.h"
#include "mr/node/node_clock.h"
#include "mr/node/plans.h"
#include "mr/node/side_job.h"
#include "mr/node/still_surface.h"
#include "mr/node/texture_stream.h"
#include "mr/scene/scene.h"
#include "mr/sensor/registration.h"
#include "mr/simplify/simplify.h"
#include "mr/still/background.h"

namespace mr::node {

/// The small computer beside a sensor (paper 3.1): one frame of depth and colour in, one packet of
/// coded mesh and video out. reconstruct() and code() may run on two threads, so that consecutive
/// frames overlap; answer() on any. Stages use the caller's arena.
class SensorNode {
 public:
  /// A frame with its surface, on the way from the first half to the second.
  struct Reconstructed {
    Frame frame;      // undistorted
    CodingPlan plan;  // of this frame
    Mesh mesh;        // decimated, on the lattice; with layers: of what moves
    float error_m = 0;
    // With layers:
    std::vector<StillChunk> still;  // chunks of the still surface that changed
    TileMask confirmed_depth, confirmed_color;
    bool began_anew = false;  // the camera was pushed: what was known does not hold any more
  };

  /// The scene must outlive the node.
  SensorNode(const Scene& scene, SensorId id, NodeClock clock = {},
             StillWork still_work = StillWork::at_once);

  const std::string& id() const { return scene_->sensor(sensor_).id; }

  /// Depth to a decimated surface; an empty one where nothing is in the volume.
  Result<Reconstructed> reconstruct(Frame frame);
  /// Takes a frame that is not reconstructed: the room is learnt from it. Between calls of
  /// reconstruct(). Returns whether more of them are wanted: most is still to be learnt.
  bool watch(Frame frame);
  /// What to tell people about an empty one.
  Error no_surface(const Frame& frame) const;
  /// Whether the frame's surface, what is still included, is empty.
  bool is_empty(const Reconstructed& surface) const;
  /// What to tell people when the sensor began to learn the room anew.
  std::string pushed(const Frame& frame) const;
  /// Labels, codes mesh and picture: the bytes of the frame's packet.
  Result<std::vector<std::byte>> code(const Reconstructed& surface);

  /// Chunks that a receiver asked for; empty when there are none. Wishes for a key frame and for a
  /// whole head are noted, what it shows of the still surface, and its plan for the next frames.
  std::vector<std::byte> answer(const codec::Control& control);

  Trace& trace() { return trace_; }
  const Trace& trace() const { return trace_; }

 private:
  struct Patch {
    simplify::Simplified surface;
    double fuse_ms = 0, simplify_ms = 0;
    bool usable = true;
  };
  /// What keeps its memory from frame to frame.
  struct PatchWorker {
    fusion::FrameFuser fuser;
    simplify::Simplifier simplifier;
  };
  /// What a sensor that stands still keeps of the room.
  struct Layers {
    still::Background background;
    StillSurface surface;            ///< the job's, while that is busy
    std::size_t chunks = 0;          ///< of the surface
    std::vector<StillChunk> unsent;  ///< changed, and the frame that was to tell came to nothing
    bool still_changed = false;      ///< since chunks were last begun
    double still_error_m = 0;        ///< of the plan that chunks were last begun with
    int waited = 0;                  ///< captures, for word that the newest chunks are shown
    bool began_anew = false;         ///< and nobody was told yet
  };
  using StillChunks = Result<std::vector<StillChunk>>;
  bool is_still_shown();
  still::BackgroundUpdate look(const Frame& frame, bool is_sent);
  StillChunks make_still(const Frame& still, int readings, double error_m);
  Status accept(StillChunks made);
  Status bring_still(const Frame& frame, const CodingPlan& plan);
  Result<ImageDepth> divide(Reconstructed& out);
  ImageDepth clean_where(const ImageMask& mask, const Camera& camera, const Frame& frame) const;
  Patch reconstruct_patch(const ImageDepth& depth, const Pose& T_world_depth, const Rect& rect,
                          const Decimation& decimation, PatchWorker& worker) const;
  Status join(const std::vector<Patch>& patches, Reconstructed& out) const;
  Packet head(const Reconstructed& surface) const;
  Status add_mesh(const Reconstructed& surface, Packet& packet);

  const Scene* scene_;
  SensorId sensor_;
  NodeClock clock_;
  CurrentPlan plan_;
  sensor::Registration registration_;
  ChunkPublisher publisher_;
  TextureStream texture_;
  codec::HeadWriter writer_;
  std::vector<PatchWorker> workers_;  ///< one per patch
  std::optional<Layers> layers_;      ///< none: everything is made anew with every frame
  StillWork still_work_;
  std::atomic<std::uint64_t> sequence_ = 0;
  /// Frames with still chunks that were reconstructed and are not coded yet.
  std::atomic<int> still_on_the_way_ = 0;
  /// One more than the sequence of the newest packet with still chunks, and of the newest whose
  /// still surface is shown.
  std::atomic<std::uint64_t> still_sent_ = 0, still_shown_ = 0;
  Trace trace_;
  SideJob<StillChunks> still_job_;  ///< last: it uses what is above
};

/// What the texturing rules take as the geometry's error in this scene: decimation (no more than a
/// voxel counts, else a few bad triangles would forbid every view), lattice and calibration.
double texturing_error_m(const Scene& scene, float mesh_error_m);

}  // namespace mr::node
