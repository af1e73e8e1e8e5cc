#include <algorithm>
#include <optional>

#include "mr/baseline/draco_points.h"
#include "mr/baseline/systems.h"
#include "mr/baseline/vpcc.h"
#include "mr/core/parallel.h"
#include "mr/node/capture.h"

namespace mr::baseline {
namespace {

constexpr std::uint32_t kMaxPoints = 1u << 24;
constexpr float kPointPerVoxel = 2.0f;  // diameter: neighbours on a slope overlap

/// Live point clouds, as LiveScan3D's with compression: merged, voxel-sampled, coloured at the
/// sender. V-PCC codes them where it is installed.
class PointStream final : public Baseline {
 public:
  explicit PointStream(const Scene& scene) : scene_(&scene), cameras_(scene), vpcc_(find_vpcc()) {}

  std::string name() const override {
    return vpcc_ ? "point cloud (V-PCC)" : "point cloud (Draco)";
  }
  Result<Bytes> encode_geometry(std::span<const Frame> capture) override;
  /// Colours go with the points.
  Result<Bytes> encode_texture(std::span<const Frame>) override { return Bytes{}; }
  Result<Geometry> decode_geometry(std::span<const std::byte> bytes) override;
  Result<Texture> decode_texture(std::span<const std::byte> bytes) override {
    if (!bytes.empty()) return corrupt("points have no pictures");
    return Texture{};
  }

 private:
  Message kind() const { return vpcc_ ? Message::points_vpcc : Message::points_draco; }
  PointSet merged_points(std::span<const Frame> capture) const;

  const Scene* scene_;
  Cameras cameras_;
  std::optional<VpccPrograms> vpcc_;
};

PointSet PointStream::merged_points(std::span<const Frame> capture) const {
  const std::vector<View> views = cameras_.views(heads_of(*scene_, capture));
  std::vector<PointSet> sets(views.size());
  parallel_for(views.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Frame& frame = frame_of(capture, sensor_of(views[i].id));
      const Camera camera = undistorted_whole(scene_->sensor(frame.sensor).depth_camera);
      PreparedDepth depth{node::prepare_depth(*scene_, camera, frame), camera, frame.T_world_depth};
      drop_flying_pixels(depth.depth, camera, scene_->sensor(frame.sensor).precision);
      sets[i] = colored_points(depth, frame.color, views[i], scene_->volume);
    }
  });
  return voxel_sampled(sets, scene_->voxel_m);
}

Result<Bytes> PointStream::encode_geometry(std::span<const Frame> capture) {
  const PointSet points = trace().time("points", [&] { return merged_points(capture); });
  if (points.positions.empty())
    return Error{Error::Cause::empty, "baseline: the capture holds no coloured point"};
  if (points.positions.size() > kMaxPoints)
    return Error{Error::Cause::too_large, "baseline: more than 2^24 points"};
  const auto coded = trace().time("encode_points", [&] {
    return vpcc_ ? encode_vpcc_points(*vpcc_, points, scene_->voxel_m)
                 : encode_draco_points(points, scene_->lattice);
  });
  if (!coded) return coded.error();
  ByteWriter out;
  write_heads(*scene_, capture, out);
  out.u32(static_cast<std::uint32_t>(points.positions.size()));
  out.block(*coded);
  return seal(kind(), out.take());
}

Result<Geometry> PointStream::decode_geometry(std::span<const std::byte> bytes) {
  const auto body = open_seal(kind(), bytes);
  if (!body) return body.error();
  ByteReader in(*body);
  const auto heads = read_heads(*scene_, in);
  if (!heads) return heads.error();
  const std::uint32_t count = in.u32();
  const auto coded = in.block();
  if (!in.at_end() || count == 0 || count > kMaxPoints)
    return corrupt("the message ends early, or late");
  auto points = trace().time("decode_points", [&] {
    return vpcc_ ? decode_vpcc_points(*vpcc_, coded, kMaxPoints)
                 : decode_draco_points(coded, count, scene_->lattice);
  });
  if (!points) return points.error();
  Mesh mesh;
  mesh.positions = std::move(points->positions);
  Geometry out = whole(std::move(mesh), 0, {}, cameras_.sources(*heads));
  Chunk chunk = *out.chunks.front();
  chunk.colors = std::move(points->colors);
  chunk.point_m = kPointPerVoxel * static_cast<float>(scene_->voxel_m);
  out.chunks = {std::make_shared<const Chunk>(std::move(chunk))};
  return out;
}

}  // namespace

std::unique_ptr<Baseline> make_points(const Scene& scene) {
  return std::make_unique<PointStream>(scene);
}

}  // namespace mr::baseline
