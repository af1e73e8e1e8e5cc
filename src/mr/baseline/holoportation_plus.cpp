#include <optional>

#include "mr/baseline/cameras.h"
#include "mr/baseline/decimate.h"
#include "mr/baseline/monolithic.h"
#include "mr/baseline/systems.h"
#include "mr/codec/mesh_codec.h"
#include "mr/core/coding_plan.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/node/chunk_grid.h"

namespace mr::baseline {
namespace {

constexpr int kMeshSpeed = CodingPlan{}.mesh_speed;  // as MeshReduce codes
constexpr std::uint32_t kMaxChunks = 1u << 16;
constexpr std::uint64_t kMaxTriangles = 1u << 24;

struct Surface {
  Mesh mesh;  // on the lattice
  float error_m = 0;
};

/// Holoportation++ of the paper: Holoportation's grid, then parallel decimation, Draco and H.264.
/// It differs from MeshReduce in that nothing is done beside the sensors.
class HoloportationPlus final : public Baseline {
 public:
  explicit HoloportationPlus(const Scene& scene) : scene_(&scene), cameras_(scene), video_(scene) {}

  std::string name() const override { return "Holoportation++"; }
  Result<Bytes> encode_geometry(std::span<const Frame> capture) override;
  Result<Bytes> encode_texture(std::span<const Frame> capture) override;
  Result<Geometry> decode_geometry(std::span<const std::byte> bytes) override;
  Result<Texture> decode_texture(std::span<const std::byte> bytes) override {
    return trace().time("decode_video", [&] { return video_.decode(cameras_, bytes); });
  }

 private:
  Result<Surface> decimated(const Mesh& fused) const;
  Result<std::vector<EncodedChunk>> code(const Surface& surface) const;
  Result<std::vector<EncodedChunk>> read_chunks(ByteReader& in) const;
  Result<Surface> decode_chunks(const std::vector<EncodedChunk>& chunks) const;

  const Scene* scene_;
  Cameras cameras_;
  CameraVideo video_;
};

Result<Surface> HoloportationPlus::decimated(const Mesh& fused) const {
  const Decimated small = decimate(fused, scene_->simplify.ratio, scene_->fusion.chunk_m);
  auto snapped = codec::snap_to_lattice(small.mesh, scene_->lattice);
  if (!snapped) return snapped.error();
  return Surface{kit::without_nonmanifold_edges(*snapped), small.error_m};
}

/// One Draco stream per cube, so that coding runs on all cores.
Result<std::vector<EncodedChunk>> HoloportationPlus::code(const Surface& surface) const {
  Mesh mesh = surface.mesh;
  set_triangle_views(mesh, std::vector<ViewId>(mesh.triangles.size(), kNoView));
  std::vector<Chunk> chunks;
  for (auto& [cube, piece] : node::split_by_cube(mesh, scene_->fusion.chunk_m))
    chunks.push_back({{{cube, kMergedSource}, 0, 1}, surface.error_m, std::move(piece)});
  std::vector<std::optional<Result<EncodedChunk>>> coded(chunks.size());
  parallel_for(chunks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      coded[i] = codec::encode_chunk(chunks[i], scene_->lattice, kMeshSpeed);
  });
  std::vector<EncodedChunk> out;
  for (auto& chunk : coded) {
    if (!*chunk) return chunk->error();
    out.push_back(**std::move(chunk));
  }
  return out;
}

Result<Bytes> HoloportationPlus::encode_geometry(std::span<const Frame> capture) {
  const Mesh fused =
      trace().time("fuse", [&] { return fuse_all(*scene_, capture, scene_->voxel_m); });
  if (fused.empty()) return Error{Error::Cause::empty, "baseline: the capture holds no surface"};
  const auto surface = trace().time("simplify", [&] { return decimated(fused); });
  if (!surface) return surface.error();
  const auto chunks = trace().time("encode_mesh", [&] { return code(*surface); });
  if (!chunks) return chunks.error();
  ByteWriter out;
  write_heads(*scene_, capture, out);
  out.f32(surface->error_m);
  out.u32(static_cast<std::uint32_t>(chunks->size()));
  for (const EncodedChunk& chunk : *chunks) {
    out.u32(chunk.triangles);
    out.block(chunk.payload);
  }
  return seal(Message::plus_geometry, out.take());
}

Result<Bytes> HoloportationPlus::encode_texture(std::span<const Frame> capture) {
  const std::vector<View> tiles = cameras_.tiles(heads_of(*scene_, capture));
  std::vector<std::optional<Result<TextureUnit>>> coded(tiles.size());
  trace().time("encode_video", [&] {
    parallel_for(tiles.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        coded[i] = video_.encode(frame_of(capture, sensor_of(tiles[i].id)), tiles[i]);
    });
  });
  std::vector<TextureUnit> units;
  for (auto& unit : coded) {
    if (!*unit) return unit->error();
    units.push_back(**std::move(unit));
  }
  return video_message(Message::video_texture, *scene_, capture, units);
}

Result<std::vector<EncodedChunk>> HoloportationPlus::read_chunks(ByteReader& in) const {
  const float error_m = in.f32();
  const std::uint32_t count = in.u32();
  if (!in.ok() || count == 0 || count > kMaxChunks) return corrupt("a wrong number of chunks");
  std::vector<EncodedChunk> chunks;
  std::uint64_t triangles = 0;
  for (std::uint32_t i = 0; i < count && in.ok(); ++i) {
    EncodedChunk chunk;
    chunk.error_m = error_m;
    chunk.triangles = in.u32();
    const auto payload = in.block();
    chunk.payload = std::vector(payload.begin(), payload.end());
    triangles += chunk.triangles;
    chunks.push_back(std::move(chunk));
  }
  if (!in.at_end()) return corrupt("the message ends early, or late");
  if (triangles > kMaxTriangles)
    return Error{Error::Cause::too_large, "baseline: too many triangles"};
  return chunks;
}

Result<Surface> HoloportationPlus::decode_chunks(const std::vector<EncodedChunk>& chunks) const {
  std::vector<std::optional<Result<Chunk>>> decoded(chunks.size());
  parallel_for(chunks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      decoded[i] = codec::decode_chunk(chunks[i], scene_->lattice);
  });
  Surface surface;
  for (const auto& chunk : decoded) {
    if (!*chunk) return chunk->error();
    append(surface.mesh, (*chunk)->mesh);
    surface.error_m = (*chunk)->error_m;
  }
  surface.mesh = kit::weld(surface.mesh);
  return surface;
}

Result<Geometry> HoloportationPlus::decode_geometry(std::span<const std::byte> bytes) {
  std::vector<SensorHead> heads;
  const auto surface = trace().time("decode_mesh", [&]() -> Result<Surface> {
    const auto body = open_seal(Message::plus_geometry, bytes);
    if (!body) return body.error();
    ByteReader in(*body);
    auto read = read_heads(*scene_, in);
    if (!read) return read.error();
    heads = *std::move(read);
    const auto chunks = read_chunks(in);
    if (!chunks) return chunks.error();
    return decode_chunks(*chunks);
  });
  if (!surface) return surface.error();
  std::vector<View> views = cameras_.views(heads);
  std::vector<SourceInfo> sources = cameras_.sources(heads);
  Mesh labelled = trace().time("label", [&] {
    return cameras_.label(surface->mesh, views, sources, AtlasConfig::Views::best_angle,
                          surface->error_m);
  });
  return whole(std::move(labelled), surface->error_m, std::move(views), std::move(sources));
}

}  // namespace

std::unique_ptr<Baseline> make_holoportation_plus(const Scene& scene) {
  return std::make_unique<HoloportationPlus>(scene);
}

}  // namespace mr::baseline
