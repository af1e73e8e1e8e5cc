#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "mr/codec/chunk_cache.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/merge/holes/guessed_surface.h"
#include "mr/node/allowance.h"
#include "mr/node/chunk_grid.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// Holds a node's live chunks, gives every chunk a version and codes what is new. A chunk whose
/// content is what it was keeps its version, and is not coded or sent again. A version is the
/// number of the publication for which it was set: none is used twice. All chunks of one packet
/// come from one mesh, so their borders fit; where chunks of the still surface wait for bytes, the
/// ones before them stay meanwhile.
class ChunkPublisher {
 public:
  /// About what a chunk takes in a packet beside its payload.
  static constexpr double kNameBytes = 100;

  ChunkPublisher(const Scene& scene, SensorId source);

  /// Chunks of a background model (codec::encode_background), which the first packet brings and
  /// every one names; as still surface, those that are not allowed wait. Before the first
  /// publish().
  void add_background(std::vector<EncodedChunk> chunks);

  // Meshes are on the lattice. The next publish() tells what is other.

  /// The moving surface, cut along the chunk grid; not called: it is what it was.
  void set_moving(const Mesh& mesh, const CubeErrors& errors,
                  const merge::GuessedSurface& guessed = {});
  /// Puts a chunk of the still surface in the place of the one in that cube; an empty mesh takes it
  /// away.
  void set_still(Vec3i cube, SurfacePiece piece);
  /// The same for the whole still surface, by cubes of any size. A cube in which nothing but the
  /// views of a few triangles is other stays as it is until the next call: what it shows is nearly
  /// right, and all of it would be sent again. Returns whether there is one.
  bool set_all_still(std::map<Vec3i, SurfacePiece> pieces);

  /// Codes the new chunks of the moving surface. Returns their bytes.
  Result<std::size_t> code_moving(int mesh_speed);
  /// Fills the packet's manifest and chunks. Of new still surface as much as is allowed: what shows
  /// where nothing was comes first, the rest waits for the next packet.
  Status publish(int mesh_speed, Packet& packet, Allowance of_still = {});

  /// About how many bytes of still surface and background wait to be sent.
  double waiting_bytes() const;
  /// Of these, the bytes of surface in whose place nothing still was sent.
  double missing_bytes() const;
  /// The cubes whose still surface waits to be sent: surface that packets have had, with other
  /// views, does not count.
  std::set<Vec3i> waiting_still() const;
  /// How often publish() was called, without those that failed.
  std::uint32_t publications() const { return publications_; }
  /// All still surface that was set before this many publications was sent.
  std::uint32_t sent_until() const;

  /// Those of the chunks that are still known, coded as an answer; empty when none is. Any thread.
  std::vector<std::byte> answer(std::vector<ChunkKey> wanted) const;
  /// null when it is not live any more. Any thread.
  std::optional<EncodedChunk> find(const ChunkKey& key) const { return cache_.find(key); }

 private:
  struct Live {
    std::uint32_t version = 0;
    SurfacePiece piece;        // what the version stands for
    bool is_new = true;        // not published yet
    bool is_outdated = false;  // some views should be others since the last set_all_still()
    bool adds_surface = true;  // else only views are other than in the version before
    std::uint32_t since = 0;   // publications, when the first surface was set that waits
    std::uint32_t before = 0;  // the version that packets name until this one is published; 0: none
    std::optional<EncodedChunk> coded = {};  // new ones only
  };
  using Item = std::pair<const ChunkId, Live>;

  static std::optional<std::size_t> relabelled(const Mesh& a, const Mesh& b);
  void bring_background(Allowance allowed, Packet& packet);
  void put(const ChunkId& id, SurfacePiece piece);
  std::vector<Item*> fresh(Layer layer);
  double bytes_of(const Live& chunk) const;
  Status code(std::span<Item* const> items, int mesh_speed);
  Status bring(std::span<Item* const> items, Allowance& allowed, int mesh_speed, Packet& packet);

  Lattice lattice_;
  double chunk_m_;
  bool reuse_;
  SensorId source_;
  std::map<ChunkId, Live> live_;
  std::uint32_t publications_ = 0;
  std::vector<EncodedChunk> background_;
  std::size_t background_sent_ = 0;  ///< number of chunks
  double bytes_per_triangle_ = 2.5;  ///< of the newest chunks
  codec::ChunkCache cache_;
};

}  // namespace mr::node
