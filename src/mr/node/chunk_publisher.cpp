#include "mr/node/chunk_publisher.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "mr/codec/mesh_codec.h"
#include "mr/codec/packet_codec.h"
#include "mr/core/parallel.h"

namespace mr::node {

ChunkPublisher::ChunkPublisher(const Scene& scene, SensorId source)
    : lattice_(scene.lattice),
      chunk_m_(scene.fusion.chunk_m),
      reuse_(scene.reuse_chunks),
      source_(source) {}

/// A chunk whose mesh did not change keeps its version, and the error_m sent with that version.
void ChunkPublisher::put(const ChunkId& id, SurfacePiece piece) {
  const auto before = live_.find(id);
  if (reuse_ && before != live_.end() && before->second.piece.mesh == piece.mesh) return;
  live_[id] = Live{publications_ + 1, std::move(piece)};
}

void ChunkPublisher::set_moving(const Mesh& mesh, const CubeErrors& errors,
                                const merge::GuessedSurface& guessed) {
  auto pieces = split_by_cube(mesh, chunk_m_);
  std::erase_if(live_, [&](const auto& item) {
    return item.first.layer == Layer::moving && !pieces.contains(item.first.cube);
  });
  for (auto& [cube, piece] : pieces) {
    std::vector<std::uint8_t> marks = guessed.marks(piece);
    put({cube, source_, Layer::moving}, {std::move(piece), errors.at(cube), std::move(marks)});
  }
}

void ChunkPublisher::set_still(Vec3i cube, SurfacePiece piece) {
  const ChunkId id{cube, source_, Layer::still};
  if (piece.mesh.empty())
    live_.erase(id);
  else
    put(id, std::move(piece));
}

/// Whether two textured meshes have the same triangles, and nearly all of them the same view.
bool ChunkPublisher::is_nearly(const Mesh& a, const Mesh& b) {
  constexpr std::size_t kFew = 100;  // one in so many
  if (a.triangles.size() != b.triangles.size() || a.views.empty() || b.views.empty()) return false;
  using Labelled = std::pair<std::array<Vec3f, 3>, ViewId>;
  const auto sorted = [](const Mesh& mesh) {
    const std::vector<ViewId> views = triangle_views(mesh);
    std::vector<Labelled> out;
    for (std::size_t t = 0; t < views.size(); ++t)
      out.push_back({{mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)}, views[t]});
    std::ranges::sort(out);
    return out;
  };
  const std::vector<Labelled> of_a = sorted(a), of_b = sorted(b);
  std::size_t others = 0;
  for (std::size_t t = 0; t < of_a.size(); ++t) {
    if (of_a[t].first != of_b[t].first) return false;
    others += of_a[t].second != of_b[t].second;
  }
  return kFew * others <= of_a.size();
}

bool ChunkPublisher::set_all_still(std::map<Vec3i, SurfacePiece> pieces) {
  bool any_outdated = false;
  std::erase_if(live_, [&](const auto& item) {
    return item.first.layer == Layer::still && !pieces.contains(item.first.cube);
  });
  for (auto& [cube, piece] : pieces) {
    const auto found = live_.find({cube, source_, Layer::still});
    Live* const before = reuse_ && found != live_.end() ? &found->second : nullptr;
    const bool was_outdated = before && std::exchange(before->is_outdated, false);
    if (before && !was_outdated && before->piece.mesh != piece.mesh &&
        is_nearly(before->piece.mesh, piece.mesh))
      any_outdated = before->is_outdated = true;
    else
      set_still(cube, std::move(piece));
  }
  return any_outdated;
}

Status ChunkPublisher::publish(int mesh_speed, Packet& packet) {
  std::vector<Chunk> fresh;
  for (auto& [id, chunk] : live_) {
    const ChunkKey key{id, 0, chunk.version};
    packet.manifest.push_back(key);
    if (chunk.is_new || !reuse_)
      fresh.push_back({key, chunk.piece.error_m, chunk.piece.mesh, chunk.piece.guessed});
  }

  std::vector<std::optional<Result<EncodedChunk>>> coded(fresh.size());
  parallel_for(fresh.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      coded[i] = codec::encode_chunk(fresh[i], lattice_, mesh_speed);
  });
  for (const auto& chunk : coded)
    if (!chunk->ok()) return chunk->error();
  for (auto& chunk : coded) {
    packet.chunks.push_back(**chunk);
    cache_.put(**std::move(chunk));
  }
  for (auto& [id, chunk] : live_) chunk.is_new = false;
  ++publications_;
  name_background(packet);
  cache_.keep(packet.manifest);
  return {};
}

void ChunkPublisher::add_background(std::vector<EncodedChunk> chunks) {
  for (EncodedChunk& chunk : chunks) {
    cache_.put(chunk);
    background_.push_back(std::move(chunk));
  }
}

void ChunkPublisher::name_background(Packet& packet) {
  if (background_.empty()) return;
  const bool first = !std::exchange(background_sent_, true);
  for (const auto& chunk : background_) {
    packet.manifest.push_back(chunk.key);
    if (first) packet.chunks.push_back(chunk);
  }
  std::sort(packet.manifest.begin(), packet.manifest.end());
  std::sort(packet.chunks.begin(), packet.chunks.end(),
            [](const EncodedChunk& a, const EncodedChunk& b) { return a.key < b.key; });
}

std::vector<std::byte> ChunkPublisher::answer(std::vector<ChunkKey> wanted) const {
  std::sort(wanted.begin(), wanted.end());
  wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
  std::vector<EncodedChunk> found;
  for (const ChunkKey& key : wanted)
    if (auto chunk = cache_.find(key)) found.push_back(*std::move(chunk));
  return found.empty() ? std::vector<std::byte>{} : codec::encode_chunks(found);
}

}  // namespace mr::node
