#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/result.h"

/// Reading glTF for background.h; private to the module.
namespace mr::model {

/// What a picture shows beyond its edges.
enum class Wrap : std::uint8_t { repeat, mirror, clamp };

/// A surface of one material, placed in the model.
struct ModelPart {
  std::vector<Vec3d> positions;        ///< [V] metres, model frame
  std::vector<Vec2f> uvs;              ///< [V] v from the top; empty without a picture
  std::vector<Vec3f> colors;           ///< [V] linear, 0..1; empty: white
  std::vector<Triangle> triangles;     ///< [T] counter-clockwise from outside
  Vec3f factor{1, 1, 1};               ///< linear; of the whole part
  std::optional<std::size_t> picture;  ///< of Model::pictures
  std::array<Wrap, 2> wrap{};          ///< along u, along v
};

struct Model {
  std::vector<ModelPart> parts;
  std::vector<ImageRgb> pictures;  ///< sRGB; empty where no part uses it
};

inline constexpr std::size_t kMaxModelBytes = std::size_t{512} << 20;
inline constexpr std::size_t kMaxModelTriangles = 2'000'000;

/// Reads a binary glTF 2.0 file: the triangles of all meshes of the default scene with their nodes'
/// transforms, baseColorFactor, baseColorTexture (PNG or JPEG inside the file) and COLOR_0. Points
/// and lines are left out. The bytes are not trusted: whatever they hold, the answer is a model
/// whose indices fit and whose numbers are finite, or an error in one line. Errors: corrupt;
/// too_large (2 million triangles, 128 million pixels); empty; unsupported (data outside the file,
/// strips and fans, sparse or compressed data).
Result<Model> read_glb(std::span<const std::byte> bytes);

}  // namespace mr::model
