#include "mr/eval/operating_point.h"

#include <algorithm>

namespace mr::eval {
namespace {

constexpr std::size_t kCoarseViews = 8;

/// The references of some frame rates at some moments and the first views.
Result<SweepReference> make_references(const Trial& trial, const std::vector<int>& dividers,
                                       const std::vector<std::size_t>& moments, std::size_t views,
                                       const QualityConfig& config) {
  SweepReference out;
  out.moments = moments;
  out.views = trial.plan().views;
  out.views.resize(std::min(views, out.views.size()));
  for (const int divider : dividers) {
    auto metric = trial.metric(moments, views, divider, config);
    if (!metric) return metric.error();
    out.by_divider.push_back(*std::move(metric));
  }
  return out;
}

double quality(const SweepPoint& p) { return p.score.masked.mean; }

bool meets(const SweepPoint& p, const OperatingTarget& target) {
  return target.mbps ? p.mbps() <= *target.mbps : quality(p) >= *target.ssim;
}

}  // namespace

std::vector<SweepPoint> pareto_front(std::vector<SweepPoint> points) {
  std::stable_sort(points.begin(), points.end(), [](const SweepPoint& a, const SweepPoint& b) {
    return std::pair(a.mbps(), -quality(a)) < std::pair(b.mbps(), -quality(b));
  });
  std::vector<SweepPoint> out;
  for (SweepPoint& point : points)
    if (out.empty() || quality(point) > quality(out.back())) out.push_back(std::move(point));
  return out;
}

std::size_t crossing(const std::vector<SweepPoint>& points, const OperatingTarget& target) {
  const auto met = [&](const SweepPoint& p) { return meets(p, target); };
  if (target.ssim) {
    const auto first = std::find_if(points.begin(), points.end(), met);
    return first == points.end() ? points.size() - 1
                                 : static_cast<std::size_t>(first - points.begin());
  }
  const auto beyond = std::find_if_not(points.begin(), points.end(), met);
  return beyond == points.begin() ? 0 : static_cast<std::size_t>(beyond - points.begin()) - 1;
}

SweepPlan operating_point_plan(const std::string& pipeline, const Scene& scene) {
  SweepPlan plan;
  const GeometrySetting own = geometry_setting(scene);
  const auto geometries = [&](const std::vector<double>& voxels, const std::vector<double>& ratios,
                              const std::vector<int>& steps, const std::vector<int>& depth_qps) {
    for (const double voxel : voxels)
      for (const double ratio : ratios)
        for (const int step : steps)
          for (const int qp : depth_qps) plan.geometries.push_back({voxel, ratio, step, qp});
  };
  const auto textures = [&](const std::vector<double>& scales, const std::vector<int>& qps) {
    for (const double scale : scales)
      for (const int qp : qps) plan.textures.push_back({scale, qp});
  };
  const double voxel = own.voxel_m;
  if (pipeline == "holoportation") {
    geometries({voxel, 0.015, 0.02, 0.03, 0.04, 0.05}, {1}, {own.step_exp}, {own.depth_qp});
    textures({1, 0.5, 0.25, 0.125}, {0});
    plan.dividers = {1, 2, 3, 6};
  } else if (pipeline == "holoportation++") {
    geometries({voxel, 0.02}, {0.5, 0.2, 0.1, 0.05}, {-9, -10}, {own.depth_qp});
    textures({1, 0.5, 0.25}, {22, 28, 34, 40});
    plan.dividers = {1, 2, 3};
  } else if (pipeline == "points") {
    geometries({0.005, 0.0075, voxel, 0.015, 0.02, 0.03, 0.04, 0.05}, {1}, {-7, -8, -9},
               {own.depth_qp});
    textures({1}, {0});
  } else if (pipeline == "rgbd") {
    geometries({voxel}, {1}, {own.step_exp}, {8, 14, 20, 26, 32});
    textures({1, 0.5, 0.25}, {22, 28, 34, 40});
  } else {
    geometries({voxel}, {0.5, 0.2, 0.1, 0.05, 0.02}, {-9, -10}, {own.depth_qp});
    textures({1, 0.75, 0.5, 0.25}, {22, 28, 34, 40});
  }
  return plan;
}

Result<OperatingPoint> find_operating_point(const Trial& trial, const std::string& pipeline,
                                            const OperatingTarget& target,
                                            const QualityConfig& config) {
  Scene scene = trial.scene();
  scene.pipeline = pipeline;
  std::string name;
  const auto run = [&](const SweepPlan& plan, const std::vector<std::size_t>& moments,
                       std::size_t views) -> Result<std::vector<SweepPoint>> {
    Moments some = trial.moments();  // a system with memory runs through all that it knows of
    some.first.resize(*std::ranges::max_element(moments) + 1);
    auto system = make_system(scene, {some, config.rig_cache, config.eval_cache, plan.geometries});
    if (!system) return system.error();
    name = (*system)->name();
    const auto references = make_references(trial, plan.dividers, moments, views, config);
    if (!references) return references.error();
    return sweep(**system, plan, *references, scene.fps, Store({}),
                 [&](std::size_t done, std::size_t of) {
                   if (config.progress) config.progress(name, done, of);
                 });
  };
  const auto rough = run(operating_point_plan(pipeline, scene), {0}, kCoarseViews);
  if (!rough) return rough.error();

  // The rough measurement may be a little off: its neighbours are tried as well, each with a
  // texture of its own.
  const std::vector<SweepPoint> best = pareto_front(*rough);
  const std::size_t middle = crossing(best, target);
  std::vector<SweepPoint> fine;
  for (std::size_t i = middle > 0 ? middle - 1 : 0; i < std::min(middle + 3, best.size()); ++i) {
    auto again = run({{best[i].geometry}, {best[i].texture}, {best[i].divider}},
                     trial.all_moments(), trial.plan().views.size());
    if (!again) return again.error();
    fine.push_back(again->front());
  }
  fine = pareto_front(std::move(fine));
  const SweepPoint point = fine[crossing(fine, target)];
  return OperatingPoint{pipeline, name, meets(point, target), point};
}

}  // namespace mr::eval
