#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/result.h"

namespace mr::model {

/// The triangles that one texture stream colours, or their vertices do, as other tools take them.
struct BakedPart {
  std::optional<StreamId> stream;                   ///< none: no texture
  std::vector<Vec3f> positions;                     ///< [V] metres, world frame
  std::vector<Vec2f> uvs;                           ///< [V] v from the top; empty without a stream
  std::vector<std::array<std::uint8_t, 3>> colors;  ///< [V] sRGB, of a background; else empty
  std::vector<Triangle> triangles;                  ///< [T]
};

/// Brings a scene's chunks together with texture coordinates in place of projection, each into the
/// view of its label and its chunk's layer (core/view.h: texturing_view): one part per stream that
/// is used, then one of the background with its colours, then one with neither.
/// Vertices are welded where position and coordinate or colour are equal. Coordinates are clamped
/// to half a texel inside the view's tile; a triangle that crosses a panorama's seam follows the
/// turn of its first corner; one with a corner that its view cannot see (behind a pinhole) loses
/// its texture. Triangles that move are cut along their picture's alpha. Errors: empty without
/// triangles; invalid for a position that is not finite, a vertex, view, colour or texture stream
/// that is not there, or a tile outside its picture.
Result<std::vector<BakedPart>> bake(const DecodedScene& scene);

/// By stream.
using Pictures = std::map<StreamId, std::shared_ptr<const ImageRgb>>;

/// The scene's pictures as they are shown: each view's tile times its gain. Tiles must not overlap
/// where gains differ; a tile outside its picture is left out.
Pictures shown_textures(const DecodedScene& scene);

/// The colour at a texture coordinate, bilinear, clamped to the picture's edge.
std::array<std::uint8_t, 3> sample(const ImageRgb& picture, Vec2f uv);

}  // namespace mr::model
