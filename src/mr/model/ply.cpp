#include <cstdint>

#include "mr/model/writers.h"

namespace mr::model {
namespace {

/// How the vertices were turned, for those who want them back in the world.
std::string pose_comment(const Pose& T_file_world) {
  std::string out = "comment T_file_world";
  for (const double value : T_file_world.matrix()) out += ' ', put_number(out, value + 0.0);
  return out + "\n";
}

}  // namespace

Result<Bytes> to_ply(const std::vector<BakedPart>& parts, const Pictures& pictures,
                     const Pose& T_file_world) {
  std::size_t vertices = 0, triangles = 0;
  for (const BakedPart& part : parts)
    vertices += part.positions.size(), triangles += part.triangles.size();
  if (vertices > 0x7FFFFFFF)
    return Error{Error::Cause::too_large, "a .ply file holds at most 2^31 vertices"};
  Bytes out;
  out.reserve(512 + vertices * 15 + triangles * 13);
  put_text(out, "ply\nformat binary_little_endian 1.0\ncomment MeshReduce\n" +
                    pose_comment(T_file_world) + "element vertex " + std::to_string(vertices) +
                    "\nproperty float x\nproperty float y\nproperty float z\n"
                    "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                    "element face " +
                    std::to_string(triangles) +
                    "\nproperty list uchar int vertex_indices\nend_header\n");
  for (const BakedPart& part : parts)
    for (std::size_t v = 0; v < part.positions.size(); ++v) {
      put(out, part.positions[v]);
      put(out, part.stream            ? sample(*pictures.at(*part.stream), part.uvs[v])
               : !part.colors.empty() ? part.colors[v]
                                      : kNeutralColor);
    }
  std::uint32_t base = 0;
  for (const BakedPart& part : parts) {
    for (const Triangle& triangle : part.triangles) {
      put(out, std::uint8_t{3});
      for (const std::uint32_t vertex : triangle) put(out, base + vertex);
    }
    base += static_cast<std::uint32_t>(part.positions.size());
  }
  return out;
}

}  // namespace mr::model
