#include "mr/baseline/vertex_colors.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "mr/baseline/photographed_grid.h"
#include "mr/core/parallel.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"

namespace mr::baseline {
namespace {

using Color = std::array<std::uint8_t, 3>;

constexpr double kLeastCosine = 0.1;  // more grazing: not seen
constexpr double kHidden_voxels = 2;

struct ColorCamera {
  Camera camera;
  Pose T_world_camera, T_camera_world;
  Rect inside;  ///< what the original picture covers
  const ImageRgb* picture;
};

std::vector<ColorCamera> color_cameras(const PhotographedGrid& grid) {
  std::vector<ColorCamera> out;
  for (std::size_t v = 0; v < grid.views.size(); ++v) {
    const View& view = grid.views[v];
    out.push_back({view.camera(), view.T_world_camera, view.T_world_camera.inverse(),
                   view.image_rect, grid.pictures[v]});
  }
  return out;
}

/// A sum of colours with weights.
struct ColorSum {
  Vec3d sum;
  double weight = 0;

  void add(const Color& color, double w) {
    sum += Vec3d{double(color[0]), double(color[1]), double(color[2])} * w;
    weight += w;
  }
  Color mean() const {
    Color out{};
    for (int c = 0; c < 3; ++c) out[c] = static_cast<std::uint8_t>(std::lround(sum[c] / weight));
    return out;
  }
};

/// Adds what a camera shows of a point, if it sees it.
void add_view(const ColorCamera& from, Vec3d p, Vec3d normal, const kit::RayScene& surface,
              double hidden_m, ColorSum& out) {
  const Rect& in = from.inside;
  const auto pixel = project(from.camera, from.T_camera_world * p);
  if (!pixel || pixel->x < in.x || pixel->y < in.y || pixel->x > in.x + in.width - 1 ||
      pixel->y > in.y + in.height - 1)
    return;
  const Vec3d eye = from.T_world_camera.translation;
  const double range_m = length(p - eye);
  const Vec3d along = (p - eye) / range_m;
  const double cosine = -dot(normal, along);
  if (!(cosine >= kLeastCosine)) return;
  if (surface.first_hit(vec_cast<float>(eye), vec_cast<float>(along), 0,
                        static_cast<float>(range_m - hidden_m)))
    return;
  out.add(sample_bilinear(*from.picture, in, pixel->x, pixel->y), cosine);
}

/// Gives vertices without colour the mean of their neighbours, ring by ring; what no ring reaches
/// stays grey. `seen`: [V] 1 where there is a colour.
void spread(const Mesh& mesh, std::vector<std::uint8_t> seen, std::vector<Color>& colors) {
  std::vector<Triangle> open = mesh.triangles;
  for (;;) {
    std::erase_if(open, [&](const Triangle& t) { return seen[t[0]] && seen[t[1]] && seen[t[2]]; });
    std::vector<std::pair<std::uint32_t, std::uint32_t>>
        links;  // to a vertex without, from one with
    for (const Triangle& t : open)
      for (const std::uint32_t to : t)
        for (const std::uint32_t from : t)
          if (!seen[to] && seen[from]) links.push_back({to, from});
    if (links.empty()) return;
    std::ranges::sort(links);
    for (std::size_t i = 0; i < links.size();) {
      const std::uint32_t to = links[i].first;
      ColorSum sum;
      for (; i < links.size() && links[i].first == to; ++i) sum.add(colors[links[i].second], 1);
      colors[to] = sum.mean();
    }
    for (const auto& [to, from] : links) seen[to] = 1;
  }
}

std::vector<Color> vertex_colors(const Mesh& mesh, std::span<const ColorCamera> cameras,
                                 double voxel_m) {
  const std::vector<Vec3f> normals = kit::vertex_normals(mesh);
  const kit::RayScene surface(std::vector<const Mesh*>{&mesh});
  std::vector<Color> colors(mesh.positions.size(), Color{128, 128, 128});
  std::vector<std::uint8_t> seen(mesh.positions.size(), 0);
  parallel_for(colors.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      ColorSum sum;
      for (const ColorCamera& camera : cameras)
        add_view(camera, vec_cast<double>(mesh.positions[v]), vec_cast<double>(normals[v]), surface,
                 kHidden_voxels * voxel_m, sum);
      if (sum.weight > 0) colors[v] = sum.mean(), seen[v] = 1;
    }
  });
  spread(mesh, std::move(seen), colors);
  return colors;
}

}  // namespace

Result<DecodedScene> vertex_colored_scene(const Scene& scene, std::span<const Frame> capture) {
  auto grid = PhotographedGrid::of(scene, capture);
  if (!grid) return grid.error();
  Chunk chunk;
  chunk.colors = vertex_colors(grid->mesh, color_cameras(*grid), scene.voxel_m);
  chunk.mesh = std::move(grid->mesh);
  return grid->shown(std::move(chunk));
}

}  // namespace mr::baseline
