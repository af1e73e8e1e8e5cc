// decode_chunk on any bytes: no crash, and what it accepts is on the lattice and can be coded
// again.
#include <cstdlib>

#include "mr/codec/mesh_codec.h"
#include "patched.h"
#include "support/meshes.h"

namespace {

using namespace mr;

enum class Kind { plain, labelled, background };

EncodedChunk valid_chunk(int speed, Kind kind) {
  Chunk chunk;
  auto mesh = codec::snap_to_lattice(test::sphere({0, 0, 1}, 0.5f, 6), {});
  if (!mesh) std::abort();
  chunk.mesh = std::move(*mesh);
  std::vector<ViewId> views(chunk.mesh.triangles.size(), ViewId{1});
  for (std::size_t t = 0; kind == Kind::labelled && t < views.size(); ++t)
    views[t] = t % 9 == 8 ? kNoView : static_cast<ViewId>(t / 40);
  if (kind != Kind::background) set_triangle_views(chunk.mesh, views);
  if (kind == Kind::background) {
    chunk.key.id.source = kBackgroundSource;
    for (std::size_t v = 0; v < chunk.mesh.positions.size(); ++v)
      chunk.colors.push_back({static_cast<std::uint8_t>(v), 90, 200});
  }
  auto encoded = codec::encode_chunk(chunk, {}, speed);
  if (!encoded) std::abort();
  return std::move(*encoded);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const EncodedChunk valid[] = {valid_chunk(0, Kind::labelled),
                                       valid_chunk(5, Kind::labelled),
                                       valid_chunk(10, Kind::labelled), valid_chunk(5, Kind::plain),
                                       valid_chunk(2, Kind::background)};
  if (size < 2) return 0;
  EncodedChunk chunk = valid[data[0] % 5];
  chunk.payload = mr::fuzz::patched(chunk.payload, mr::fuzz::as_bytes(data + 1, size - 1));
  // Sets the expected values to the header's, or every input would be refused.
  if ((data[0] & 128) != 0 && chunk.payload.size() > 14)
    chunk.triangles = std::to_integer<std::uint32_t>(chunk.payload[13]);
  const auto mesh = codec::decode_chunk(chunk, {});
  if (!mesh) return 0;
  const auto again = codec::encode_chunk(*mesh, {}, 5);
  if (again && !codec::decode_chunk(*again, {})) std::abort();
  return 0;
}
