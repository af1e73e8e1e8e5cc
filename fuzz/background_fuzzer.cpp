// A background model of any bytes: no crash, and what it accepts decodes.
#include <cstdlib>

#include "mr/codec/background_chunks.h"
#include "mr/codec/mesh_codec.h"
#include "mr/model/background.h"
#include "patched.h"
#include "support/glb.h"
#include "support/meshes.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mr;
  static const std::vector<std::byte> valid =
      test::glb_of(test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 2, 2),
                   {.picture = ImageRgb(4, 4, 90), .colors = std::vector<Vec3f>(9, {1, 1, 1})});
  const auto glb = fuzz::patched(valid, fuzz::as_bytes(data, size));
  const auto mesh = model::read_background(glb, {}, {}, 20);
  if (!mesh) return 0;
  const auto chunks = codec::encode_background(*mesh, {}, 100);
  if (!chunks) return 0;
  for (const EncodedChunk& chunk : *chunks)
    if (!codec::decode_chunk(chunk, {})) std::abort();
  return 0;
}
