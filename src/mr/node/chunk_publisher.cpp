#include "mr/node/chunk_publisher.h"

#include <algorithm>
#include <array>
#include <cmath>
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
  Live chunk{publications_ + 1, std::move(piece)};
  chunk.since = publications_;
  if (before != live_.end()) {
    const Live& old = before->second;
    chunk.before = old.is_new ? old.before : old.version;
    if (old.is_new && old.adds_surface) chunk.since = old.since;
  }
  live_[id] = std::move(chunk);
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

/// How many triangles of two meshes with the same ones have another view; nothing: they have
/// others.
std::optional<std::size_t> ChunkPublisher::relabelled(const Mesh& a, const Mesh& b) {
  if (a.triangles.size() != b.triangles.size() || a.views.empty() || b.views.empty())
    return std::nullopt;
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
    if (of_a[t].first != of_b[t].first) return std::nullopt;
    others += of_a[t].second != of_b[t].second;
  }
  return others;
}

bool ChunkPublisher::set_all_still(std::map<Vec3i, SurfacePiece> pieces) {
  constexpr std::size_t kFew = 100;  // one triangle in so many
  bool any_outdated = false;
  std::erase_if(live_, [&](const auto& item) {
    return item.first.layer == Layer::still && !pieces.contains(item.first.cube);
  });
  for (auto& [cube, piece] : pieces) {
    const auto found = live_.find({cube, source_, Layer::still});
    Live* const before = reuse_ && found != live_.end() ? &found->second : nullptr;
    const bool was_outdated = before && std::exchange(before->is_outdated, false);
    const bool is_other = before && before->piece.mesh != piece.mesh;
    const auto others = is_other ? relabelled(before->piece.mesh, piece.mesh) : std::nullopt;
    if (!was_outdated && others && kFew * *others <= piece.mesh.triangles.size()) {
      any_outdated = before->is_outdated = true;
      continue;
    }
    const bool adds = !others || (before->is_new && before->adds_surface);
    set_still(cube, std::move(piece));
    if (is_other) live_.at({cube, source_, Layer::still}).adds_surface = adds;
  }
  return any_outdated;
}

/// The chunks to be sent; of the still surface first those that show where nothing was, then what
/// has waited for longest.
std::vector<ChunkPublisher::Item*> ChunkPublisher::fresh(Layer layer) {
  std::vector<Item*> out;
  for (Item& item : live_)
    if (item.first.layer == layer && (item.second.is_new || !reuse_)) out.push_back(&item);
  if (layer == Layer::still)
    std::ranges::stable_sort(out, {}, [](const Item* item) {
      const Live& chunk = item->second;
      return std::tuple(!chunk.is_new, chunk.before != 0, chunk.since);
    });
  return out;
}

Status ChunkPublisher::code(std::span<Item* const> items, int mesh_speed) {
  std::vector<std::optional<Result<EncodedChunk>>> coded(items.size());
  parallel_for(items.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto& [id, chunk] = *items[i];
      const SurfacePiece& piece = chunk.piece;
      if (!chunk.coded)
        coded[i] =
            codec::encode_chunk({{id, 0, chunk.version}, piece.error_m, piece.mesh, piece.guessed},
                                lattice_, mesh_speed);
    }
  });
  for (const auto& chunk : coded)
    if (chunk && !chunk->ok()) return chunk->error();
  for (std::size_t i = 0; i < items.size(); ++i)
    if (coded[i]) items[i]->second.coded = **std::move(coded[i]);
  return {};
}

Result<std::size_t> ChunkPublisher::code_moving(int mesh_speed) {
  const std::vector<Item*> moving = fresh(Layer::moving);
  if (const Status coded = code(moving, mesh_speed); !coded) return coded.error();
  std::size_t bytes = 0;
  for (const Item* item : moving) bytes += item->second.coded->payload.size();
  return bytes;
}

/// Puts these chunks into the packet, in this order, as far as the bytes go.
Status ChunkPublisher::bring(std::span<Item* const> items, Allowance& allowed, int mesh_speed,
                             Packet& packet) {
  constexpr std::size_t kAtOnce = 8;  // coded together where some may have to wait
  const bool is_limited = std::isfinite(allowed.bytes);
  const std::size_t step = is_limited ? kAtOnce : std::max<std::size_t>(items.size(), 1);
  double coded_bytes = 0, triangles = 0;
  bool has_room = true;
  for (std::size_t first = 0; has_room && first < items.size(); first += step) {
    const auto some = items.subspan(first, std::min(step, items.size() - first));
    has_room = allowed.bytes > 0 || allowed.one_anyway;
    if (!has_room) break;
    if (const Status coded = code(some, mesh_speed); !coded) return coded;
    for (Item* item : some) {
      Live& chunk = item->second;
      const auto size = static_cast<double>(chunk.coded->payload.size());
      coded_bytes += size, triangles += static_cast<double>(chunk.piece.mesh.triangles.size());
      has_room = has_room && allowed.take(size + kNameBytes);
      if (!has_room) continue;
      packet.chunks.push_back(*chunk.coded);
      cache_.put(*std::exchange(chunk.coded, std::nullopt));
      chunk.is_new = false;
    }
  }
  if (triangles > 0) bytes_per_triangle_ = coded_bytes / triangles;
  return {};
}

Status ChunkPublisher::publish(int mesh_speed, Packet& packet, Allowance of_still) {
  Allowance all;
  Status brought = bring(fresh(Layer::moving), all, mesh_speed, packet);
  if (brought) brought = bring(fresh(Layer::still), of_still, mesh_speed, packet);
  if (!brought) return brought;
  std::ranges::sort(packet.chunks, {}, &EncodedChunk::key);
  for (const auto& [id, chunk] : live_)
    if (const std::uint32_t shown = chunk.is_new ? chunk.before : chunk.version; shown > 0)
      packet.manifest.push_back({id, 0, shown});
  ++publications_;
  if (std::isfinite(of_still.bytes) && !fresh(Layer::still).empty()) of_still = {0, false};
  bring_background(of_still, packet);
  cache_.keep(packet.manifest);
  return {};
}

double ChunkPublisher::bytes_of(const Live& chunk) const {
  return chunk.coded ? static_cast<double>(chunk.coded->payload.size())
                     : bytes_per_triangle_ * static_cast<double>(chunk.piece.mesh.triangles.size());
}

double ChunkPublisher::missing_bytes() const {
  double out = 0;
  for (const auto& [id, chunk] : live_)
    if (chunk.is_new && chunk.before == 0 && id.layer == Layer::still) out += bytes_of(chunk);
  return out;
}

double ChunkPublisher::waiting_bytes() const {
  double out = 0;
  for (const auto& [id, chunk] : live_)
    if (chunk.is_new && id.layer == Layer::still) out += bytes_of(chunk);
  for (const EncodedChunk& chunk : std::span(background_).subspan(background_sent_))
    out += static_cast<double>(chunk.payload.size());
  return out;
}

/// What was set since the last publish() does not wait yet.
std::set<Vec3i> ChunkPublisher::waiting_still() const {
  std::set<Vec3i> out;
  for (const auto& [id, chunk] : live_)
    if (chunk.is_new && chunk.version <= publications_ && chunk.adds_surface &&
        id.layer == Layer::still)
      out.insert(id.cube);
  return out;
}

std::uint32_t ChunkPublisher::sent_until() const {
  std::uint32_t out = publications_;
  for (const auto& [id, chunk] : live_)
    if (chunk.is_new && chunk.adds_surface && id.layer == Layer::still)
      out = std::min(out, chunk.since);
  return out;
}

void ChunkPublisher::add_background(std::vector<EncodedChunk> chunks) {
  for (EncodedChunk& chunk : chunks) {
    cache_.put(chunk);
    background_.push_back(std::move(chunk));
  }
}

void ChunkPublisher::bring_background(Allowance allowed, Packet& packet) {
  if (background_.empty()) return;
  for (; background_sent_ < background_.size(); ++background_sent_) {
    const EncodedChunk& chunk = background_[background_sent_];
    if (!allowed.take(static_cast<double>(chunk.payload.size()))) break;
    packet.chunks.push_back(chunk);
  }
  for (const EncodedChunk& chunk : std::span(background_).first(background_sent_))
    packet.manifest.push_back(chunk.key);
  std::ranges::sort(packet.manifest);
  std::ranges::sort(packet.chunks, {}, &EncodedChunk::key);
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
