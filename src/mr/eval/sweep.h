#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/eval/multi_view_ssim.h"
#include "mr/eval/system.h"
#include "mr/render/renderer.h"

namespace mr::eval {

/// What a sweep tries: every geometry with every texture, each sent in every `dividers`-th capture.
struct SweepPlan {
  std::vector<GeometrySetting> geometries;
  std::vector<TextureSetting> textures;
  std::vector<int> dividers{1};
};

/// What pictures are compared with.
struct SweepReference {
  std::vector<render::Viewpoint> views;
  std::vector<std::size_t> moments;       ///< of the system, one per moment of each metric
  std::vector<MultiViewSsim> by_divider;  ///< [dividers], each of these moments and views
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

/// How much of a sweep is done, in textures coded and views drawn.
using SweepProgress = std::function<void(std::size_t done, std::size_t of)>;

/// Codes each half once, draws each geometry once per view and shades it with every texture. Scores
/// are kept in `scores`, so that an interrupted sweep goes on where it was. [geometries * textures
/// * dividers], in that order.
Result<std::vector<SweepPoint>> sweep(System& system, const SweepPlan& plan,
                                      const SweepReference& references, double fps,
                                      const Store& scores, const SweepProgress& progress = {});

/// The points that no mixture of others beats: the upper left convex hull of quality over rate, by
/// rising rate. Places in `points`.
std::vector<std::size_t> pareto_hull(const std::vector<SweepPoint>& points);

/// Every point as a line: settings, rates, quality, against what, whether it is on the hull.
std::string to_csv(const std::vector<SweepPoint>& points, ReferenceKind reference);

}  // namespace mr::eval
