#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "mr/core/frame.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/core/scene.h"
#include "mr/core/trace.h"
#include "mr/node/chunk_publisher.h"
#include "mr/node/texture_stream.h"
#include "mr/sensor/registration.h"

namespace mr::node {

/// The small computer beside a sensor (paper 3.1): one frame of depth and colour in, one packet of
/// coded mesh and video out. Single-threaded object; its stages use the caller's arena.
class SensorNode {
 public:
  /// The scene must outlive the node.
  SensorNode(const Scene& scene, std::uint32_t sensor_index);

  const std::string& id() const { return scene_->sensors[sensor_].id; }

  /// The bytes of the frame's packet. empty: the depth holds no surface.
  Result<std::vector<std::byte>> process(Frame frame);

  /// A chunk that a receiver lacks; null when forgotten.
  std::shared_ptr<const EncodedChunk> find(const ChunkKey& key) const {
    return publisher_.find(key);
  }
  void ask_key_frame() { texture_.ask_key_frame(); }

  const Trace& trace() const { return trace_; }

 private:
  struct Surface {
    Mesh mesh;
    float error_m = 0;
  };
  std::vector<Mesh> fuse(const Frame& frame) const;
  Result<Surface> simplify(const std::vector<Mesh>& pieces, double ratio) const;

  const Scene* scene_;
  std::uint32_t sensor_;
  sensor::Registration registration_;
  ChunkPublisher publisher_;
  TextureStream texture_;
  std::uint64_t sequence_ = 0;
  Trace trace_;
};

/// What the texturing rules take as the geometry's error in this scene: decimation (no more than a
/// voxel counts, else a few bad triangles would forbid every view), lattice and calibration.
double texturing_error_m(const Scene& scene, float mesh_error_m);

}  // namespace mr::node
