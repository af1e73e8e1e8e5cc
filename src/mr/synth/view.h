#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "mr/synth/noise.h"
#include "mr/synth/people.h"
#include "mr/synth/pixel_shader.h"
#include "mr/synth/tile_coverage.h"

namespace mr::synth {

/// One rendered frame of a sensor: depth, and the colour pixels that differ from the empty room.
struct Shot {
  struct Span {
    std::uint32_t first = 0, count = 0;  ///< pixels, row by row

    friend bool operator==(const Span&, const Span&) = default;
  };

  std::vector<std::uint16_t> depth_mm;  ///< [H*W]
  std::vector<Span> spans;
  std::vector<std::uint8_t> rgb;  ///< of the spans' pixels, one after another

  friend bool operator==(const Shot&, const Shot&) = default;
};

/// The true parameters of one sensor of a rig, injected errors included.
struct ViewSetup {
  PosedCamera depth;
  std::optional<PosedCamera> color;
  DepthNoise noise;
  Vec3f gain{1, 1, 1};     ///< exposure and white balance
  std::uint64_t seed = 0;  ///< of the noise
};

/// Renders one sensor's pictures by ray casting. Room and camera are static, so the empty room is
/// rendered once; afterwards only pixels that people cover are cast and shaded. Not thread-safe.
class SensorView {
 public:
  SensorView(std::shared_ptr<const Room> room, ViewSetup setup);

  const ImageRgb& empty_room() const { return empty_color_; }

  /// `people` may be null; `frame` seeds the noise.
  Shot render(const PosedPeople* people, std::uint64_t frame);

 private:
  void cast_empty_room_depth();
  void render_empty_room_color();
  void cast_depth(const PosedPeople& people, const TileCoverage& cover);
  void cast_color(const PosedPeople& people, const TileCoverage& cover);
  void shade_color(const PixelShader& shader, const TileCoverage& cover, Rect tile);
  void shade_shadows(const PosedPeople& people, TileCoverage& cover);
  void take_changes(const TileCoverage& cover, Shot& shot);

  const std::shared_ptr<const Room> room_;
  const ViewSetup setup_;
  const ToneCurve tone_;
  DepthTruth empty_, depth_;           // depth_: of the frame under way, else the empty room's
  ImageRgb empty_color_, color_;       // likewise
  std::vector<float> color_distance_;  // [H*W] of the empty room, along the colour camera's rays
  ImageId hits_;                       // triangles of people, valid where the frame's cover is
};

}  // namespace mr::synth
