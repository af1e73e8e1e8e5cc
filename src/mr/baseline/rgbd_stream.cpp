#include <algorithm>
#include <chrono>
#include <optional>

#include "mr/baseline/cameras.h"
#include "mr/baseline/depth_video.h"
#include "mr/baseline/monolithic.h"
#include "mr/baseline/systems.h"
#include "mr/core/parallel.h"
#include "mr/node/capture.h"

namespace mr::baseline {
namespace {

/// The paper's placement 1: every sensor sends depth and colour as video, the receiver makes the
/// mesh. Depth is smoothed as fusion wants it before it is coded: noise costs the most bits.
class RgbdStream final : public Baseline {
 public:
  explicit RgbdStream(const Scene& scene);

  std::string name() const override { return "RGB-D streaming"; }
  Result<Bytes> encode_geometry(std::span<const Frame> capture) override;
  Result<Bytes> encode_texture(std::span<const Frame> capture) override;
  Result<Geometry> decode_geometry(std::span<const std::byte> bytes) override;
  Result<Texture> decode_texture(std::span<const std::byte> bytes) override {
    return trace().time("decode_video", [&] { return video_.decode(cameras_, bytes); });
  }
  double critical_path_ms(const CallTimes& calls) const override;

 private:
  Result<TextureUnit> encode_depth(const Frame& frame);
  Result<std::vector<PreparedDepth>> decode_depth(std::span<const SensorHead> heads,
                                                  ByteReader& in);

  const Scene* scene_;
  Cameras cameras_;
  CameraVideo video_;
  std::vector<std::unique_ptr<node::TextureStream>> encoders_;  // of depth, by sensor
  std::vector<std::unique_ptr<kit::VideoDecoder>> decoders_;    // of depth, by sensor
  std::vector<double> depth_ms_, color_ms_;                     // newest capture, by sensor
};

DepthRange range_of(const SensorConfig& sensor) {
  return {sensor.depth_near_m, sensor.depth_far_m};
}

RgbdStream::RgbdStream(const Scene& scene)
    : scene_(&scene),
      cameras_(scene),
      video_(scene),
      decoders_(scene.sensors.size()),
      depth_ms_(scene.sensors.size()),
      color_ms_(scene.sensors.size()) {
  for (const SensorId id : all_sensors(scene.sensors))
    encoders_.push_back(std::make_unique<node::TextureStream>(scene, stream_of(id)));
}

/// Sensors are nodes of their own, so they are timed one after another; the slowest counts.
double RgbdStream::critical_path_ms(const CallTimes& calls) const {
  double slowest = 0;
  for (std::size_t i = 0; i < depth_ms_.size(); ++i)
    slowest = std::max(slowest, depth_ms_[i] + color_ms_[i]);
  return slowest + calls.decode_geometry_ms;
}

Result<TextureUnit> RgbdStream::encode_depth(const Frame& frame) {
  const SensorConfig& sensor = scene_->sensor(frame.sensor);
  const Stopwatch stopwatch(depth_ms_[index_of(frame.sensor)]);
  const ImageDepth depth = trace().time("prepare_depth", [&] {
    return node::prepare_depth(*scene_, undistorted_whole(sensor.depth_camera), frame);
  });
  return trace().time("encode_depth", [&] {
    return encoders_[index_of(frame.sensor)]->encode(depth_to_picture(depth, range_of(sensor)),
                                                     scene_->coding.depth_qp, 0);
  });
}

Result<Bytes> RgbdStream::encode_geometry(std::span<const Frame> capture) {
  std::fill(depth_ms_.begin(), depth_ms_.end(), 0.0);
  if (capture.empty()) return Error{Error::Cause::empty, "baseline: no sensor delivered"};
  std::vector<TextureUnit> units;
  for (const SensorHead& head : heads_of(*scene_, capture)) {
    auto unit = encode_depth(frame_of(capture, head.sensor));
    if (!unit) return unit.error();
    units.push_back(*std::move(unit));
  }
  return video_message(Message::depth_video, *scene_, capture, units);
}

Result<Bytes> RgbdStream::encode_texture(std::span<const Frame> capture) {
  std::fill(color_ms_.begin(), color_ms_.end(), 0.0);
  std::vector<TextureUnit> units;
  for (const View& tile : cameras_.tiles(heads_of(*scene_, capture))) {
    const SensorId sensor = sensor_of(tile.id);
    const Stopwatch stopwatch(color_ms_[index_of(sensor)]);
    auto unit = trace().time("encode_video",
                             [&] { return video_.encode(frame_of(capture, sensor), tile); });
    if (!unit) return unit.error();
    units.push_back(*std::move(unit));
  }
  return video_message(Message::video_texture, *scene_, capture, units);
}

Result<std::vector<PreparedDepth>> RgbdStream::decode_depth(std::span<const SensorHead> heads,
                                                            ByteReader& in) {
  std::vector<std::span<const std::byte>> units(heads.size());
  for (auto& unit : units) unit = in.block();
  if (!in.at_end()) return corrupt("the message ends early, or late");
  std::vector<std::optional<Result<PreparedDepth>>> decoded(heads.size());
  parallel_for(heads.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const SensorConfig& sensor = scene_->sensor(heads[i].sensor);
      const Camera camera = undistorted_whole(sensor.depth_camera);
      const auto picture = decode_unit(decoders_[index_of(heads[i].sensor)], units[i],
                                       (camera.width + 1) / 2 * 2, 2 * camera.height);
      if (!picture) {
        decoded[i] = picture.error();
        continue;
      }
      decoded[i] =
          PreparedDepth{picture_to_depth(*picture, camera.width, camera.height, range_of(sensor)),
                        camera, heads[i].T_world_depth};
    }
  });
  std::vector<PreparedDepth> out;
  for (auto& depth : decoded) {
    if (!*depth) return depth->error();
    out.push_back(**std::move(depth));
  }
  return out;
}

Result<Geometry> RgbdStream::decode_geometry(std::span<const std::byte> bytes) {
  const auto body = open_seal(Message::depth_video, bytes);
  if (!body) return body.error();
  ByteReader in(*body);
  const auto heads = read_heads(*scene_, in);
  if (!heads) return heads.error();
  const auto depths = trace().time("decode_depth", [&] { return decode_depth(*heads, in); });
  if (!depths) return depths.error();
  const Mesh mesh =
      trace().time("fuse", [&] { return fuse_prepared(*scene_, *depths, scene_->voxel_m); });
  if (mesh.empty()) return Error{Error::Cause::empty, "baseline: the capture holds no surface"};
  std::vector<View> views = cameras_.views(*heads);
  std::vector<SourceInfo> sources = cameras_.sources(*heads);
  Mesh labelled = trace().time("label", [&] {
    return cameras_.label(mesh, views, sources, AtlasConfig::Views::best_angle, 0);
  });
  return whole(std::move(labelled), 0, std::move(views), std::move(sources));
}

}  // namespace

std::unique_ptr<Baseline> make_rgbd(const Scene& scene) {
  return std::make_unique<RgbdStream>(scene);
}

}  // namespace mr::baseline
