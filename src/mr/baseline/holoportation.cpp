#include <cmath>
#include <cstring>
#include <optional>

#include "mr/baseline/cameras.h"
#include "mr/baseline/monolithic.h"
#include "mr/baseline/systems.h"
#include "mr/core/parallel.h"

namespace mr::baseline {
namespace {

/// Whether marching cubes can have made it: nothing off the lattice's cube, no edge longer than a
/// cell's diagonal.
bool plausible(const Mesh& mesh, const Scene& scene) {
  for (const Vec3f& p : mesh.positions)
    if (!is_finite(p) || !Lattice::contains(scene.lattice.quantize(p))) return false;
  const auto longest = static_cast<float>(scene.voxel_m * std::sqrt(3.0) * 1.01);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const std::uint32_t v : mesh.triangles[t])
      if (v >= mesh.positions.size()) return false;
    for (int i = 0; i < 3; ++i)
      if (length(mesh.corner(t, i) - mesh.corner(t, (i + 1) % 3)) > longest) return false;
  }
  return true;
}

/// A vector of numbers from a block of LZ4.
template <typename Numbers>
Status unpack(std::span<const std::byte> packed, std::size_t count, Numbers& out) {
  if (!lz4_plausible(packed.size(), std::uint64_t{count} * sizeof(typename Numbers::value_type)))
    return corrupt("an LZ4 block of impossible size");
  out.resize(count);
  return lz4_decompress(packed, std::as_writable_bytes(std::span(out)));
}

/// Holoportation (Orts-Escolano et al. 2016) as the paper compares with it: one grid, nothing
/// decimated, positions, indices and raw pictures by LZ4. The receiver textures by projection.
class Holoportation final : public Baseline {
 public:
  explicit Holoportation(const Scene& scene) : scene_(&scene), cameras_(scene) {}

  std::string name() const override { return "Holoportation"; }
  Result<Bytes> encode_geometry(std::span<const Frame> capture) override;
  Result<Bytes> encode_texture(std::span<const Frame> capture) override;
  Result<Geometry> decode_geometry(std::span<const std::byte> bytes) override;
  Result<Texture> decode_texture(std::span<const std::byte> bytes) override;

 private:
  const Scene* scene_;
  Cameras cameras_;
};

Result<Bytes> Holoportation::encode_geometry(std::span<const Frame> capture) {
  const Mesh mesh =
      trace().time("fuse", [&] { return fuse_all(*scene_, capture, scene_->voxel_m); });
  if (mesh.empty()) return Error{Error::Cause::empty, "baseline: the capture holds no surface"};
  return trace().time("encode_mesh", [&]() -> Result<Bytes> {
    const auto positions = lz4_compress(std::as_bytes(std::span(mesh.positions)));
    if (!positions) return positions.error();
    const auto indices = lz4_compress(std::as_bytes(std::span(mesh.triangles)));
    if (!indices) return indices.error();
    ByteWriter out;
    write_heads(*scene_, capture, out);
    out.u32(static_cast<std::uint32_t>(mesh.positions.size()));
    out.u32(static_cast<std::uint32_t>(mesh.triangles.size()));
    out.block(*positions);
    out.block(*indices);
    return seal(Message::holoportation_geometry, out.take());
  });
}

Result<Bytes> Holoportation::encode_texture(std::span<const Frame> capture) {
  const std::vector<View> tiles = cameras_.tiles(heads_of(*scene_, capture));
  std::vector<std::optional<Result<Bytes>>> pictures(tiles.size());
  trace().time("encode_pictures", [&] {
    parallel_for(tiles.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const ImageRgb picture =
            tile_picture(frame_of(capture, sensor_of(tiles[i].id)).color, tiles[i]);
        pictures[i] = lz4_compress(std::as_bytes(std::span(picture.data)));
      }
    });
  });
  ByteWriter out;
  write_heads(*scene_, capture, out);
  for (const auto& picture : pictures) {
    if (!*picture) return picture->error();
    out.block(**picture);
  }
  return seal(Message::holoportation_texture, out.take());
}

Result<Geometry> Holoportation::decode_geometry(std::span<const std::byte> bytes) {
  Mesh mesh;
  std::vector<SensorHead> heads;
  const Status decoded = trace().time("decode_mesh", [&]() -> Status {
    const auto body = open_seal(Message::holoportation_geometry, bytes);
    if (!body) return body.error();
    ByteReader in(*body);
    auto read = read_heads(*scene_, in);
    if (!read) return read.error();
    heads = *std::move(read);
    const std::uint32_t vertices = in.u32(), triangles = in.u32();
    const auto positions = in.block(), indices = in.block();
    if (!in.at_end()) return corrupt("the message ends early, or late");
    if (const Status ok = unpack(positions, vertices, mesh.positions); !ok) return ok;
    if (const Status ok = unpack(indices, triangles, mesh.triangles); !ok) return ok;
    if (!plausible(mesh, *scene_)) return corrupt("no mesh of this grid");
    return {};
  });
  if (!decoded) return decoded.error();
  std::vector<View> views = cameras_.views(heads);
  std::vector<SourceInfo> sources = cameras_.sources(heads);
  Mesh labelled = trace().time("label", [&] {
    return cameras_.label(mesh, views, sources, AtlasConfig::Views::best_angle, 0);
  });
  return whole(std::move(labelled), 0, std::move(views), std::move(sources));
}

Result<Texture> Holoportation::decode_texture(std::span<const std::byte> bytes) {
  const auto body = open_seal(Message::holoportation_texture, bytes);
  if (!body) return body.error();
  ByteReader in(*body);
  const auto heads = read_heads(*scene_, in);
  if (!heads) return heads.error();
  Texture out{cameras_.tiles(*heads), {}};
  return trace().time("decode_pictures", [&]() -> Result<Texture> {
    for (const View& view : out.views) {
      const auto block = in.block();
      const Rect& size = view.atlas_rect;
      auto picture = std::make_shared<ImageRgb>();
      picture->width = size.width, picture->height = size.height;
      const std::size_t bytes_raw = std::size_t{3} * size.width * size.height;
      if (const Status ok = unpack(block, bytes_raw, picture->data); !ok) return ok.error();
      out.pictures[view.stream] = std::move(picture);
    }
    if (!in.at_end()) return corrupt("the message ends early, or late");
    return std::move(out);
  });
}

}  // namespace

std::unique_ptr<Baseline> make_holoportation(const Scene& scene) {
  return std::make_unique<Holoportation>(scene);
}

}  // namespace mr::baseline
