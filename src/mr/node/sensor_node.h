#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "mr/codec/control.h"
#include "mr/codec/head.h"
#include "mr/core/frame.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/core/trace.h"
#include "mr/node/chunk_publisher.h"
#include "mr/node/link_pace.h"
#include "mr/node/node_clock.h"
#include "mr/node/plans.h"
#include "mr/node/sensor_layers.h"
#include "mr/node/side_job.h"
#include "mr/node/surface_reconstructor.h"
#include "mr/node/texture_stream.h"
#include "mr/rate/features.h"
#include "mr/scene/scene.h"
#include "mr/sensor/blind_tiles.h"
#include "mr/sensor/registration.h"

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
    CubeErrors errors;
    TileMask blind_color;
    ImageMask alpha;                        ///< still::Outline
    std::optional<FrameFeatures> features;  ///< where rate is controlled
    // With layers:
    SensorLayers::News still;
    TileMask confirmed_depth, confirmed_color;
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
  /// Learns the room from a frame that is not reconstructed; does nothing without layers.
  void learn(Frame frame);
  /// See SensorLayers::Memory; nothing without layers.
  std::optional<SensorLayers::Memory> memory() const;
  void recall(SensorLayers::Memory memory);
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
  Result<ImageDepth> depth_to_reconstruct(Reconstructed& out);
  Packet head(const Reconstructed& surface) const;
  Status add_picture(const Reconstructed& surface, Packet& packet);
  Status add_mesh(const Reconstructed& surface, Packet& packet);
  Status publish(Packet& packet);

  const Scene* scene_;
  SensorId sensor_;
  NodeClock clock_;
  CurrentPlan plan_;
  Trace trace_;
  sensor::Registration registration_;
  std::optional<rate::FeatureExtractor> features_;  ///< none: rate is not controlled
  std::optional<sensor::BlindTiles> blind_tiles_;   ///< none: the sensor has no colour
  std::optional<SensorLayers> layers_;  ///< none: everything is reconstructed with every frame
  SurfaceReconstructor reconstructor_;
  ChunkPublisher publisher_;
  std::optional<LinkPace> link_pace_;        ///< none: the link's limit is not known
  std::deque<std::uint32_t> unsent_stills_;  ///< publications before which they were set
  TextureStream texture_;
  codec::HeadWriter writer_;
  std::atomic<std::uint64_t> sequence_ = 0;
};

/// What the texturing rules take as the geometry's error in this scene: decimation (no more than a
/// voxel counts, else a few bad triangles would forbid every view), lattice and calibration.
double texturing_error_m(const Scene& scene, float mesh_error_m);

}  // namespace mr::node
