#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/image.h"
#include "mr/core/result.h"
#include "mr/render/renderer.h"
#include "mr/scene/scene.h"

/// How far the outlines of people, as a client draws them, lie from those of the truth.
namespace mr::eval {

inline constexpr double kOutlineStep_m = 0.05;  ///< people stand out from the room by at least this
inline constexpr int kOutlineReach_px = 40;     ///< what lies farther from a true person is ignored
inline constexpr int kOutlineMost_px = 20;      ///< a distance counts as at most this

/// Distances between outlines, summed up.
struct OutlineDistance {
  double sum_px = 0;
  std::uint64_t pixels = 0;

  void add(const OutlineDistance& other) { sum_px += other.sum_px, pixels += other.pixels; }
};

/// 1 where something stands at least kOutlineStep_m before the room; depth 0: nothing there. The
/// pictures have one size; metres along z.
ImageMask people_mask(const ImageDepth& depth, const ImageDepth& room);

/// The pixels within `reach_px` columns and rows of those that a mask marks.
ImageMask grown(const ImageMask& mask, int reach_px);

/// The pixels of `mask` within `region` with one of the four neighbours outside the mask, but
/// inside picture and region.
ImageMask outline_of(const ImageMask& mask, const ImageMask& region);

/// From each pixel of either outline to the nearest one of the other, at most kOutlineMost_px. Only
/// pixels outside `left_out` count; empty: all.
OutlineDistance outline_distance(const ImageMask& a, const ImageMask& b,
                                 const ImageMask& left_out = {});

/// Mean distances between the outlines of people.
struct OutlineError {
  double all_px = 0;
  /// The same without outlines within kUnseenReach_px of people that no sensor sees (nobody can
  /// draw these), and without what lies within kOutlineStep_m of the room in space: things that are
  /// drawn too wide, such as books in a shelf. Nothing: none is left.
  std::optional<double> seen_px;
};
inline constexpr int kUnseenReach_px = 5;

/// Compares pictures of 1280x720 (vertical field of view 60 degrees) from these viewpoints with
/// those of the truth of a capture. The scene must be prepared. `pictures`: a folder for what was
/// drawn, with the truth's outline in green and the drawn one in red; empty: none. Nothing: its rig
/// is not known or has no people, or none is seen.
Result<std::optional<OutlineError>> outline_error(const Scene& scene, const DecodedScene& shown,
                                                  int capture,
                                                  const std::vector<render::Viewpoint>& views,
                                                  const std::filesystem::path& pictures = {});

}  // namespace mr::eval
