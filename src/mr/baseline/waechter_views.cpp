#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "mr/baseline/waechter.h"
#include "mr/core/parallel.h"
#include "mr/kit/graph_cut.h"
#include "mr/kit/raster.h"
#include "mr/kit/topology.h"

namespace mr::baseline {
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

/// A view and the gradient of its picture.
struct Gradient {
  const View* view;
  Camera camera;
  Pose T_camera_world;
  Vec3f eye;
  ImageDepth magnitude;
};

/// Whether the segment from a camera to a corner is free.
bool is_free(const Photographed& in, Vec3f eye, Vec3f corner) {
  constexpr float kNear = 0.01f, kBefore = 0.99f;  // of its length
  return std::ranges::none_of(in.hiding, [&](const kit::RayScene* rays) {
    return rays->first_hit(eye, corner - eye, kNear, kBefore).has_value();
  });
}

/// A triangle's sum in one view.
float gradient_sum(const Photographed& in, const Gradient& from, std::size_t t) {
  const Mesh& mesh = *in.surface;
  if (dot(mesh.area_normal(t), from.eye - mesh.centroid(t)) <= 0) return 0;
  const Rect& r = from.view->image_rect;
  const double g = from.view->gutter_px;
  std::array<Vec3d, 3> corners;
  for (int i = 0; i < 3; ++i) {
    corners[i] = from.T_camera_world * vec_cast<double>(mesh.corner(t, i));
    const auto p = project(from.camera, corners[i]);
    if (!p || p->x < r.x + g || p->y < r.y + g || p->x > r.x + r.width - 1 - g ||
        p->y > r.y + r.height - 1 - g)
      return 0;
  }
  for (int i = 0; i < 3; ++i)
    if (!is_free(in, from.eye, mesh.corner(t, i))) return 0;
  float sum = 1e-3f;
  kit::scan_polygon(kit::clip_to_screen(from.camera, corners), from.camera.width, 0,
                    from.camera.height, [&](const kit::ScreenSpan& s) {
                      for (int x = s.first; x <= s.last; ++x) sum += *from.magnitude.at(x, s.y);
                    });
  return sum;
}

}  // namespace

std::vector<float> gradient_sums(const Photographed& in) {
  std::vector<Gradient> gradients;
  for (std::size_t v = 0; v < in.views.size(); ++v) {
    const View& view = in.views[v];
    gradients.push_back({&view, view.camera(), view.T_world_camera.inverse(),
                         vec_cast<float>(view.T_world_camera.translation),
                         gradient_of(*in.pictures[v])});
  }
  std::vector<float> out(in.surface->triangles.size() * gradients.size());
  parallel_for(in.surface->triangles.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t)
      for (std::size_t v = 0; v < gradients.size(); ++v)
        out[t * gradients.size() + v] = gradient_sum(in, gradients[v], t);
  });
  return out;
}

std::vector<int> cut_views(const Mesh& surface, std::size_t views, std::span<const float> sums) {
  std::vector<float> seen;
  for (const float sum : sums)
    if (sum > 0) seen.push_back(sum);
  std::vector<int> label(surface.triangles.size(), -1);
  if (seen.empty()) return label;
  const auto top = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() * 995 / 1000);
  std::nth_element(seen.begin(), top, seen.end());
  std::vector<float> cost(sums.size());
  for (std::size_t i = 0; i < cost.size(); ++i)
    cost[i] = sums[i] > 0 ? std::max(0.0f, 1 - sums[i] / *top) : kNever;
  for (std::size_t t = 0; t < label.size(); ++t) {
    const auto first = cost.begin() + static_cast<std::ptrdiff_t>(t * views);
    const auto best = std::min_element(first, first + static_cast<std::ptrdiff_t>(views));
    if (*best < kNever) label[t] = static_cast<int>(best - first);
  }
  std::vector<kit::CutEdge> edges;
  const auto twin = kit::edge_table(surface).twin;
  for (std::uint32_t h = 0; h < twin.size(); ++h)
    if (twin[h] != kit::kNoTwin && h < twin[h]) edges.push_back({h / 3, twin[h] / 3});
  const auto potts = [](std::size_t, int a, int b) { return a == b ? 0.0 : 1.0; };
  kit::expand_labels(cost, static_cast<int>(views), edges, potts, label);
  return label;
}

}  // namespace mr::baseline
