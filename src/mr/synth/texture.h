#pragma once

#include <cstdint>
#include <string>

#include "mr/core/vec.h"

namespace mr::synth {

/// The procedural texture of a surface.
enum class Pattern : std::uint8_t {
  plain,
  planks,   ///< floor boards along u
  wood,     ///< grain along u
  rug,      ///< bordered, with diamonds
  stripes,  ///< upright, 12 over the width
  checker,  ///< 9 x 6 squares with a margin
  text,     ///< lines of `text`, framed
  book,     ///< a spine
  picture,  ///< a landscape
  leaf,
  face,   ///< skin; eyes, brows (accent), lips around the middle of the surface
  hair,   ///< strands along v
  knit,   ///< stitches in columns
  denim,  ///< twill with worn places (accent)
  bands,  ///< a knit with level stripes
  plaid,  ///< woven checks
  print,  ///< a knit with `text` in its middle
  film,   ///< coloured waves and a bright square that move with `phase`
};

/// A procedural material. Colours are linear, 0..1; lengths in metres.
struct Material {
  Pattern pattern = Pattern::plain;
  Vec3f color{0.5f, 0.5f, 0.5f};
  Vec3f accent{0.1f, 0.1f, 0.1f};  ///< of letters, lines, every other square
  Vec2f size_m{1, 1};              ///< the surface's extent
  std::string text;         ///< capitals, digits and blanks; '^' is an arrow; '\n' ends a line
  float grain = 0.12f;      ///< strength of the 1/f noise
  Vec2f grain_scale{1, 1};  ///< stretches it: (1, 8) gives streaks along u
  float emission = 0;       ///< over 0: emissive, independent of incident light
  std::uint32_t seed = 0;
  float phase = 0;  ///< of a film
};

/// 1/f noise (fractal noise) of a material at a point of its surface, about -1..1.
float grain_at(const Material& material, Vec2f surface_m);

/// The albedo at a point of the surface: x to the right, y up from the lower left corner, seen from
/// outside. `grain`: of grain_at(), scaled to the wanted contrast.
Vec3f paint(const Material& material, Vec2f surface_m, float grain);

/// 0xRRGGBB as it is picked on a screen → linear.
Vec3f linear_color(std::uint32_t srgb);

}  // namespace mr::synth
