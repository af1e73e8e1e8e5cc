#include "mr/render/scene_geometry.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>

#include "mr/core/parallel.h"

namespace mr::render {
namespace {

/// A run of triangles, or all points, of a chunk on their way into the index list.
struct DrawRange {
  ViewId view = kNoView;
  Layer layer = Layer::moving;  ///< if it has a view
  bool colored = false;
  float point_m = 0;
  std::uint32_t chunk = 0, first = 0, count = 0;

  /// Ranges with equal keys are drawn together; sorted by view, coloured ones and points last.
  auto key() const { return std::tuple(view, layer, colored, point_m); }
};

bool has_points(const Chunk& chunk) { return chunk.point_m > 0; }

Status check(const Chunk& chunk) {
  const Mesh& mesh = chunk.mesh;
  const auto invalid_chunk = [](const char* what) {
    return Error{Error::Cause::invalid, std::string("chunk cannot be drawn: ") + what};
  };
  if (!std::isfinite(chunk.point_m)) return invalid_chunk("its points have no finite size");
  if (has_points(chunk) && !mesh.triangles.empty())
    return invalid_chunk("it has both points and triangles");
  if (!chunk.colors.empty() && chunk.colors.size() != mesh.positions.size())
    return invalid_chunk("it has colours for some of its vertices only");
  for (const ViewRun& run : mesh.views)
    if (std::uint64_t{run.first} + run.count > mesh.triangles.size())
      return invalid_chunk("a view run ends after the last triangle");
  for (const Triangle& triangle : mesh.triangles)
    for (const std::uint32_t vertex : triangle)
      if (vertex >= mesh.positions.size())
        return invalid_chunk("a triangle names a vertex it does not have");
  for (const Vec3f p : mesh.positions)
    if (!is_finite(p)) return invalid_chunk("a position is not finite");
  return {};
}

Status check(const DecodedScene& scene) {
  std::vector<Status> checked(scene.chunks.size());
  parallel_for(scene.chunks.size(), 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) checked[i] = check(*scene.chunks[i]);
  });
  for (const Status& status : checked)
    if (!status) return status;
  return {};
}

/// The ranges of a scene in drawing order. A mesh without labels, or with colours, is one range
/// without a view.
std::vector<DrawRange> draw_ranges_of(const DecodedScene& scene) {
  std::vector<DrawRange> out;
  for (std::uint32_t i = 0; i < scene.chunks.size(); ++i) {
    const Chunk& chunk = *scene.chunks[i];
    const bool colored = !chunk.colors.empty();
    const auto all = [](const auto& list) { return static_cast<std::uint32_t>(list.size()); };
    if (has_points(chunk))
      out.push_back({kNoView, {}, colored, chunk.point_m, i, 0, all(chunk.mesh.positions)});
    else if (colored || chunk.mesh.views.empty())
      out.push_back({kNoView, {}, colored, 0, i, 0, all(chunk.mesh.triangles)});
    else
      for (const ViewRun& run : chunk.mesh.views)
        out.push_back({run.id, run.id == kNoView ? Layer::moving : chunk.key.id.layer, false, 0, i,
                       run.first, run.count});
  }
  std::erase_if(out, [](const DrawRange& range) { return range.count == 0; });
  std::stable_sort(out.begin(), out.end(),
                   [](const DrawRange& a, const DrawRange& b) { return a.key() < b.key(); });
  return out;
}

/// Where each chunk's vertices begin: first those of triangles, then those of points.
std::vector<std::uint32_t> place_vertices(const DecodedScene& scene, SceneGeometry& out) {
  std::vector<std::uint32_t> first(scene.chunks.size());
  std::uint32_t vertices = 0;
  for (const bool points : {false, true}) {
    if (points) out.first_point = vertices;
    for (std::size_t i = 0; i < scene.chunks.size(); ++i) {
      const Chunk& chunk = *scene.chunks[i];
      if (has_points(chunk) != points) continue;
      first[i] = vertices;
      vertices += static_cast<std::uint32_t>(chunk.mesh.positions.size()) * (points ? 3 : 1);
    }
  }
  out.positions.resize(vertices);
  const bool colored = std::any_of(scene.chunks.begin(), scene.chunks.end(),
                                   [](const auto& chunk) { return !chunk->colors.empty(); });
  out.colors.resize(colored ? vertices : 0);
  return first;
}

/// Ranges and parts of the ranges.
void place_indices(const std::vector<DrawRange>& ranges, SceneGeometry& out) {
  std::size_t indices = 0;
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const DrawRange& range = ranges[i];
    if (i == 0 || range.key() != ranges[i - 1].key())
      out.ranges.push_back({range.view, range.layer, range.colored, range.point_m, i, 0});
    ++out.ranges.back().parts;
    out.parts.push_back({indices, 3 * std::size_t{range.count}, range.chunk});
    indices += out.parts.back().indices;
  }
  out.indices.resize(indices);
}

/// The middle of the scene in whole metres, so that what lies on a lattice stays exact.
Vec3d origin_of(const DecodedScene& scene, std::vector<Box3f>& boxes) {
  boxes.resize(scene.chunks.size());
  parallel_for(boxes.size(), 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (const Vec3f p : scene.chunks[i]->mesh.positions) boxes[i].add(p);
  });
  Box3d all;
  for (const Box3f& box : boxes) {
    if (box.empty()) continue;
    all.add(vec_cast<double>(box.low));
    all.add(vec_cast<double>(box.high));
  }
  if (all.empty()) return {};
  const Vec3d middle = (all.low + all.high) * 0.5;
  return {std::round(middle.x), std::round(middle.y), std::round(middle.z)};
}

/// Positions and colours of one chunk from vertex `at` on.
void put_vertices(const Chunk& chunk, std::size_t at, SceneGeometry& out) {
  const int copies = has_points(chunk) ? 3 : 1;
  for (std::size_t v = 0; v < chunk.mesh.positions.size(); ++v)
    for (int copy = 0; copy < copies; ++copy, ++at) {
      out.positions[at] = vec_cast<float>(vec_cast<double>(chunk.mesh.positions[v]) - out.origin);
      if (!chunk.colors.empty()) out.colors[at] = chunk.colors[v];
    }
}

void put_indices(const DrawRange& range, const Mesh& mesh, std::uint32_t base, std::uint32_t* to) {
  if (range.point_m > 0)
    for (std::uint32_t i = 0; i < 3 * range.count; ++i) *to++ = base + i;
  else
    for (std::uint32_t t = range.first; t < range.first + range.count; ++t)
      for (const std::uint32_t vertex : mesh.triangles[t]) *to++ = base + vertex;
}

}  // namespace

Result<SceneGeometry> gather(const DecodedScene& scene) {
  if (auto ok = check(scene); !ok) return ok.error();
  std::uint64_t vertices = 0;
  for (const auto& chunk : scene.chunks)
    vertices += chunk->mesh.positions.size() * (has_points(*chunk) ? 3 : 1);
  if (vertices > 0xFFFFFFFFu) return Error{Error::Cause::too_large, "scene has over 2^32 vertices"};

  SceneGeometry out;
  const std::vector<DrawRange> ranges = draw_ranges_of(scene);
  const std::vector<std::uint32_t> base = place_vertices(scene, out);
  place_indices(ranges, out);
  out.origin = origin_of(scene, out.boxes);
  parallel_for(scene.chunks.size(), 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      put_vertices(*scene.chunks[i], base[i], out);
      for (Vec3f* p : {&out.boxes[i].low, &out.boxes[i].high})
        *p = vec_cast<float>(vec_cast<double>(*p) - out.origin);
    }
  });
  parallel_for(ranges.size(), 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      put_indices(ranges[i], scene.chunks[ranges[i].chunk]->mesh, base[ranges[i].chunk],
                  out.indices.data() + out.parts[i].first_index);
  });
  return out;
}

}  // namespace mr::render
