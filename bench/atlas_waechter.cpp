#include <cmath>
#include <limits>
#include <optional>

#include "atlas_contenders.h"
#include "mr/core/parallel.h"
#include "mr/kit/raster.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"
#include "support/graph_cut.h"

namespace mr::bench {
namespace {

constexpr float kNever = std::numeric_limits<float>::infinity();

/// Magnitude of the brightness gradient by central differences, of 255.
ImageDepth gradient_of(const ImageRgb& picture) {
  ImageDepth out(picture.width, picture.height);
  const auto grey = [&](int x, int y) {
    const std::uint8_t* const p = picture.at(x, y);
    return 0.299f * p[0] + 0.587f * p[1] + 0.114f * p[2];
  };
  parallel_for(picture.height, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 1; y > 0 && y + 1 < picture.height && x + 1 < picture.width; ++x)
        *out.at(x, y) =
            0.5f * std::hypot(grey(x + 1, y) - grey(x - 1, y), grey(x, y + 1) - grey(x, y - 1));
  });
  return out;
}

class Waechter final : public Work {
 public:
  Waechter(const AtlasCase& input, int threads) : input_(input), arena_(threads) {
    arena_.run([&] {
      if (input_.still.empty()) return;
      const Mesh* const meshes[] = {&input_.still};
      still_.emplace(meshes);
    });
  }

  void clear() override { label_.clear(); }
  void run(StageClock& clock) override {
    arena_.run([&] {
      const Mesh* const meshes[] = {&input_.surface};
      const kit::RayScene rays(meshes);
      const std::vector<float> quality = qualities(rays);
      clock.lap("data");
      choose(quality);
      clock.lap("cut");
    });
  }
  Message result() override { return label_message(input_.surface, label_); }

 private:
  std::size_t views() const { return input_.views.size(); }

  /// Whether the segment from the camera to a corner is free.
  bool sees(const kit::RayScene& rays, Vec3f eye, Vec3f corner) const {
    constexpr float kNear = 0.01f, kBefore = 0.99f;  // of its length
    const auto is_hit = [&](const kit::RayScene& scene) {
      return scene.first_hit(eye, corner - eye, kNear, kBefore).has_value();
    };
    return !is_hit(rays) && !(still_ && is_hit(*still_));
  }

  /// The gradient summed over a triangle's pixels; 0: the view does not see it.
  float quality(const kit::RayScene& rays, const View& view, const ImageDepth& gradient,
                std::size_t t) const {
    const Vec3f eye = vec_cast<float>(view.T_world_camera.translation);
    if (dot(input_.surface.area_normal(t), eye - input_.surface.centroid(t)) <= 0) return 0;
    const Camera camera = view.camera();
    const Pose T_camera_world = view.T_world_camera.inverse();
    std::array<Vec3d, 3> corners;
    for (int i = 0; i < 3; ++i) {
      corners[i] = T_camera_world * vec_cast<double>(input_.surface.corner(t, i));
      const auto p = project(camera, corners[i]);
      const double g = view.gutter_px;
      if (!p || p->x < g || p->y < g || p->x > view.width - 1 - g || p->y > view.height - 1 - g)
        return 0;
    }
    for (int i = 0; i < 3; ++i)
      if (!sees(rays, eye, input_.surface.corner(t, i))) return 0;
    float sum = 1e-3f;
    kit::scan_polygon(kit::clip_to_screen(camera, corners), camera.width, 0, camera.height,
                      [&](const kit::ScreenSpan& s) {
                        for (int x = s.first; x <= s.last; ++x) sum += *gradient.at(x, s.y);
                      });
    return sum;
  }

  std::vector<float> qualities(const kit::RayScene& rays) const {
    std::vector<ImageDepth> gradients;
    for (const ImageRgb& picture : input_.pictures) gradients.push_back(gradient_of(picture));
    std::vector<float> out(input_.surface.triangles.size() * views());
    parallel_for(input_.surface.triangles.size(), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t)
        for (std::size_t v = 0; v < views(); ++v)
          out[t * views() + v] = quality(rays, input_.views[v], gradients[v], t);
    });
    return out;
  }

  /// Costs: 1 - quality / its 99.5th percentile; 1 for an edge between two views.
  void choose(const std::vector<float>& quality) {
    std::vector<float> seen;
    for (const float q : quality)
      if (q > 0) seen.push_back(q);
    label_.assign(input_.surface.triangles.size(), -1);
    if (seen.empty()) return;
    const auto top = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() * 995 / 1000);
    std::nth_element(seen.begin(), top, seen.end());
    std::vector<float> cost(quality.size());
    for (std::size_t i = 0; i < cost.size(); ++i)
      cost[i] = quality[i] > 0 ? std::max(0.0f, 1 - quality[i] / *top) : kNever;
    for (std::size_t t = 0; t < label_.size(); ++t) {
      const auto first = cost.begin() + static_cast<std::ptrdiff_t>(t * views());
      const auto best = std::min_element(first, first + static_cast<std::ptrdiff_t>(views()));
      if (*best < kNever) label_[t] = static_cast<int>(best - first);
    }
    std::vector<test::CutEdge> edges;
    const auto twin = kit::edge_table(input_.surface).twin;
    for (std::uint32_t h = 0; h < twin.size(); ++h)
      if (twin[h] != kit::kNoTwin && h < twin[h]) edges.push_back({h / 3, twin[h] / 3});
    const auto potts = [](std::size_t, int a, int b) { return a == b ? 0.0 : 1.0; };
    test::expand_labels(cost, static_cast<int>(views()), edges, potts, label_);
  }

  const AtlasCase& input_;
  Arena arena_;
  std::optional<kit::RayScene> still_;
  std::vector<int> label_;
};

}  // namespace

Contender atlas_waechter(const AtlasCase& input, int threads) {
  return {"waechter", threads, Message::object(),
          [&input, threads] { return std::make_unique<Waechter>(input, threads); }};
}

}  // namespace mr::bench
