#include "mr/codec/background_chunks.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "mr/codec/mesh_codec.h"
#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/kit/srgb.h"

namespace mr::codec {
namespace {

constexpr std::size_t kMaxChunks = 32768;  // half of what a manifest may hold
constexpr int kMeshSpeed = 2;              // coded once, sent to everybody

/// A mesh on the lattice with the colours to be sent.
struct SnappedBackground {
  Mesh mesh;
  std::vector<std::array<std::uint8_t, 3>> colors;  ///< [V] sRGB
};

/// Snaps the mesh to the lattice; vertices that are welded get their mean colour.
Result<SnappedBackground> snap(const ColoredMesh& in, const Lattice& lattice) {
  auto snapped = snap_vertices(in.mesh, lattice);
  if (!snapped) return snapped.error();
  SnappedBackground out{std::move(snapped->mesh), {}};
  std::vector<Vec3f> sum(out.mesh.positions.size());
  std::vector<float> count(sum.size());
  for (std::size_t v = 0; v < in.colors.size(); ++v) {
    const std::uint32_t to = snapped->vertex_of[v];
    if (to != Snapped::kGone) sum[to] += in.colors[v], count[to] += 1;
  }
  out.colors.reserve(sum.size());
  for (std::size_t v = 0; v < sum.size(); ++v)
    out.colors.push_back(kit::to_srgb(sum[v] / count[v]));
  return out;
}

/// The triangles, grouped by the cube that contains their centroid.
std::map<Vec3i, std::vector<std::uint32_t>> by_cube(const Mesh& mesh, double chunk_m) {
  const auto cell = [&](float v) { return static_cast<std::int32_t>(std::floor(v / chunk_m)); };
  std::map<Vec3i, std::vector<std::uint32_t>> out;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f c = mesh.centroid(t);
    out[{cell(c.x), cell(c.y), cell(c.z)}].push_back(t);
  }
  return out;
}

std::vector<Chunk> split(const SnappedBackground& in, double chunk_m) {
  std::vector<Chunk> out;
  std::vector<std::uint32_t> number(in.mesh.positions.size()), chunk_of(number.size());
  for (const auto& [cube, triangles] : by_cube(in.mesh, chunk_m)) {
    Chunk& chunk = out.emplace_back();
    chunk.key = {{cube, kBackgroundSource}, 0, 1};
    for (const std::uint32_t t : triangles) {
      Triangle triangle = in.mesh.triangles[t];
      for (std::uint32_t& v : triangle) {
        if (chunk_of[v] != out.size()) {
          chunk_of[v] = static_cast<std::uint32_t>(out.size());
          number[v] = static_cast<std::uint32_t>(chunk.mesh.positions.size());
          chunk.mesh.positions.push_back(in.mesh.positions[v]);
          chunk.colors.push_back(in.colors[v]);
        }
        v = number[v];
      }
      chunk.mesh.triangles.push_back(triangle);
    }
  }
  return out;
}

Result<std::vector<EncodedChunk>> encode(const std::vector<Chunk>& chunks, const Lattice& lattice) {
  if (chunks.empty()) return Error{Error::Cause::empty, "it has no triangles"};
  if (chunks.size() > kMaxChunks)
    return Error{Error::Cause::too_large, "it fills " + std::to_string(chunks.size()) +
                                              " cubes, at most " + std::to_string(kMaxChunks)};
  std::vector<std::optional<Result<EncodedChunk>>> coded(chunks.size());
  parallel_for(chunks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      coded[i] = encode_chunk(chunks[i], lattice, kMeshSpeed);
  });
  std::vector<EncodedChunk> out;
  for (auto& chunk : coded) {
    if (!chunk->ok()) return chunk->error();
    out.push_back(**std::move(chunk));
  }
  return out;
}

}  // namespace

Result<std::vector<EncodedChunk>> encode_background(const ColoredMesh& background,
                                                    const Lattice& lattice, double chunk_m) {
  MR_ASSERT(chunk_m > 0);
  const auto mesh = snap(background, lattice);
  if (!mesh) return mesh.error();
  return encode(split(*mesh, chunk_m), lattice);
}

}  // namespace mr::codec
