#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/frame.h"
#include "mr/core/result.h"
#include "mr/core/trace.h"
#include "mr/scene/scene.h"

/// The systems that MeshReduce is compared with (docs/evaluation.md, Baselines), as senders and
/// receivers that code and decode for real. Both ends know the scene file, cameras and poses
/// included.
namespace mr::baseline {

/// What goes over the wire for one capture. Geometry and texture are coded apart, so that sweeps
/// can vary one and keep the other.
using Bytes = std::vector<std::byte>;

/// The surface (or points) of one capture at the receiver.
struct Geometry {
  std::vector<std::shared_ptr<const Chunk>> chunks;  ///< labelled with views, or with colours
  std::vector<View> views;                           ///< full size; tiles as Texture says
  std::vector<SourceInfo> sources;
};

/// The pictures of one capture at the receiver.
struct Texture {
  std::vector<View> views;  ///< with atlas_rect and stream set to where their picture is
  std::map<StreamId, std::shared_ptr<const ImageRgb>> pictures;  ///< by stream
};

/// How long the four calls took for one capture.
struct CallTimes {
  double encode_geometry_ms = 0, encode_texture_ms = 0;
  double decode_geometry_ms = 0, decode_texture_ms = 0;
};

/// One system's sender and receiver. The capture: one undistorted frame per sensor that delivered.
/// Video carries state from call to call: calls of one kind go in the order of the captures.
/// Each stage's time goes to trace().
class Baseline {
 public:
  virtual ~Baseline() = default;

  virtual std::string name() const = 0;  ///< for people, e.g. "point cloud (Draco)"

  virtual Result<Bytes> encode_geometry(std::span<const Frame> capture) = 0;
  virtual Result<Bytes> encode_texture(std::span<const Frame> capture) = 0;  ///< may be empty
  virtual Result<Geometry> decode_geometry(std::span<const std::byte> bytes) = 0;
  virtual Result<Texture> decode_texture(std::span<const std::byte> bytes) = 0;

  /// Latency of the newest capture up to the mesh: the slowest node of each layer, each node run
  /// alone, summed over the layers. Default: one node does everything.
  virtual double critical_path_ms(const CallTimes& calls) const {
    return calls.encode_geometry_ms + calls.encode_texture_ms;
  }

  Trace& trace() { return trace_; }

 private:
  Trace trace_;
};

/// What a scene's `pipeline` key may name: ours, then the baselines.
inline const std::vector<std::string>& pipeline_names() {
  static const std::vector<std::string> names{"meshreduce", "holoportation", "holoportation++",
                                              "points", "rgbd"};
  return names;
}

/// By the scene's `pipeline` key: holoportation, holoportation++, points, rgbd. Knobs are the
/// scene's own keys:
///   voxel_m              the grid of the first two, the spacing of points
///   simplify.ratio       holoportation++
///   lattice.step_exp     position bits of holoportation++ and of points
///   coding.texture_scale, coding.texture_qp
///   coding.depth_qp      rgbd
///   coding.frame_divider every n-th capture is sent (by run_baseline, not by the baseline itself)
/// The scene must be prepared (node::prepare_scene) and outlive the baseline. unsupported: the
/// pipeline is `meshreduce`; empty: no sensor has colour.
Result<std::unique_ptr<Baseline>> make_baseline(const Scene& scene);

/// What a client draws: geometry with the pictures of the same capture.
DecodedScene join(Geometry geometry, Texture texture, TimePoint captured_at);

}  // namespace mr::baseline
