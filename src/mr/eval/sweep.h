#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "mr/core/result.h"
#include "mr/eval/multi_view_ssim.h"
#include "mr/eval/system.h"
#include "mr/render/renderer.h"

namespace mr::eval {

/// The grid of a parameter sweep: every geometry setting with every texture setting and divider
/// (every n-th capture is sent).
struct SweepPlan {
  std::vector<GeometrySetting> geometries;
  std::vector<TextureSetting> textures;
  std::vector<int> dividers{1};
};

/// The reference of a sweep.
struct SweepReference {
  std::vector<render::Viewpoint> views;
  std::vector<std::size_t> moments;       ///< of the system; those of each metric
  std::vector<MultiViewSsim> by_divider;  ///< [dividers] metrics of these moments and views
};

struct SweepPoint {
  GeometrySetting geometry;
  TextureSetting texture;
  int divider = 1;
  std::uint64_t triangles = 0;
  double geometry_mbps = 0, texture_mbps = 0;
  double refresh_mbps = 0;  ///< see DecodedStream
  MultiViewScore score;

  double mbps() const { return geometry_mbps + texture_mbps; }
};

/// Progress of a sweep, in coded textures plus rendered views.
using SweepProgress = std::function<void(std::size_t done, std::size_t of)>;

/// Evaluates all points of the plan. Codes each half once, rasterizes each geometry once per view
/// and shades it with every texture. Caches scores in `scores`, so that an interrupted sweep can
/// resume. Returns [geometries * textures * dividers], in that order.
Result<std::vector<SweepPoint>> sweep(System& system, const SweepPlan& plan,
                                      const SweepReference& references, double fps,
                                      const Store& scores, const SweepProgress& progress = {});

}  // namespace mr::eval
