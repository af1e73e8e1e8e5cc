#pragma once

#include <memory>
#include <vector>

#include "mr/baseline/wire.h"
#include "mr/kit/video.h"
#include "mr/node/texture_stream.h"
#include "mr/sensor/registration.h"

namespace mr::baseline {

/// The scene's cameras, known to both sender and receiver.
class Cameras {
 public:
  /// The scene must outlive it.
  explicit Cameras(const Scene& scene);

  const Scene& scene() const { return *scene_; }

  /// The colour cameras of a capture as views, by id, each with its own picture (stream = id).
  std::vector<View> views(std::span<const SensorHead> heads) const;
  /// The same with atlas_rect scaled by coding.texture_scale: the coded picture is the tile.
  std::vector<View> tiles(std::span<const SensorHead> heads) const;
  std::vector<SourceInfo> sources(std::span<const SensorHead> heads) const;

  /// View selection at the receiver: the mesh with a view for each triangle. `error_m`: of the
  /// mesh.
  Mesh label(const Mesh& mesh, std::span<const View> views, std::span<const SourceInfo> sources,
             AtlasConfig::Views choice, float error_m) const;

 private:
  const Scene* scene_;
  std::vector<sensor::Registration> registrations_;
};

/// The frame of a sensor; there must be one.
const Frame& frame_of(std::span<const Frame> capture, SensorId sensor);

/// The part of a colour picture inside a tile, resampled to the tile's size by area averaging.
ImageRgb tile_picture(const ImageRgb& color, const View& tile);

/// Codes colour as one H.264 stream per camera, at coding.texture_qp.
class CameraVideo {
 public:
  explicit CameraVideo(const Scene& scene);

  /// Encodes the next access unit of one camera.
  Result<TextureUnit> encode(const Frame& frame, const View& tile);
  /// Decodes a whole message: heads, then one block per view in order.
  Result<Texture> decode(const Cameras& cameras, std::span<const std::byte> message);

 private:
  const Scene* scene_;
  std::vector<std::unique_ptr<node::TextureStream>> encoders_;  // by sensor
  std::vector<std::unique_ptr<kit::VideoDecoder>> decoders_;    // by sensor, made when needed
};

/// A sealed message with the access units of one capture.
Bytes video_message(Message kind, const Scene& scene, std::span<const Frame> capture,
                    std::span<const TextureUnit> units);

/// Decodes one stream's access unit; creates the decoder if it is null. corrupt: another size.
Result<ImageRgb> decode_unit(std::unique_ptr<kit::VideoDecoder>& decoder,
                             std::span<const std::byte> unit, int width, int height);

/// Wraps a received surface as a single chunk.
Geometry whole(Mesh mesh, float error_m, std::vector<View> views, std::vector<SourceInfo> sources);

}  // namespace mr::baseline
