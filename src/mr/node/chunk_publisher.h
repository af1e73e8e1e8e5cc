#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <vector>

#include "mr/codec/chunk_cache.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/merge/holes/guessed_surface.h"
#include "mr/node/chunk_grid.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// Holds a node's live chunks, gives every chunk a version and codes what is new. A chunk whose
/// content is what it was keeps its version, and is not coded or sent again. A version is the
/// number of the publication that brings it: none is used twice. All chunks of one packet come from
/// one mesh, so their borders fit.
class ChunkPublisher {
 public:
  ChunkPublisher(const Scene& scene, SensorId source);

  /// Chunks of a background model (codec::encode_background), which every packet names and the
  /// first one brings. Before the first publish().
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

  /// Fills the packet's manifest and chunks.
  Status publish(int mesh_speed, Packet& packet);

  /// Those of the chunks that are still known, coded as an answer; empty when none is. Any thread.
  std::vector<std::byte> answer(std::vector<ChunkKey> wanted) const;
  /// null when it is not live any more. Any thread.
  std::optional<EncodedChunk> find(const ChunkKey& key) const { return cache_.find(key); }

 private:
  static bool is_nearly(const Mesh& a, const Mesh& b);
  void name_background(Packet& packet);
  void put(const ChunkId& id, SurfacePiece piece);

  struct Live {
    std::uint32_t version = 0;
    SurfacePiece piece;        // what the version stands for
    bool is_new = true;        // not published yet
    bool is_outdated = false;  // some views should be others since the last set_all_still()
  };

  Lattice lattice_;
  double chunk_m_;
  bool reuse_;
  SensorId source_;
  std::map<ChunkId, Live> live_;
  std::uint32_t publications_ = 0;
  std::vector<EncodedChunk> background_;
  bool background_sent_ = false;
  codec::ChunkCache cache_;
};

}  // namespace mr::node
