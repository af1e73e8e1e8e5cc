#include "mr/render/scene_geometry.h"

#include <map>
#include <string>
#include <utility>

namespace mr::render {
namespace {

/// A mesh that is not labelled yet, or has colours, is one run without a view.
std::vector<ViewRun> runs_of(const Chunk& chunk) {
  if (!chunk.mesh.runs.empty() && chunk.colors.empty()) return chunk.mesh.runs;
  return {{0, static_cast<std::uint32_t>(chunk.mesh.triangles.size()), kNoView}};
}

/// The colours of all vertices; nothing where no chunk has any.
std::vector<std::array<std::uint8_t, 3>> gather_colors(const DecodedScene& scene) {
  std::vector<std::array<std::uint8_t, 3>> out;
  std::size_t vertices = 0;
  for (const auto& chunk : scene.chunks) {
    if (!chunk->colors.empty()) {
      out.resize(vertices);
      out.insert(out.end(), chunk->colors.begin(), chunk->colors.end());
    }
    vertices += chunk->mesh.positions.size();
  }
  if (!out.empty()) out.resize(vertices);
  return out;
}

/// Ranges in the order in which they are drawn: by view, coloured ones last.
using RangeKey = std::pair<ViewId, bool>;

Status check(const Chunk& chunk) {
  const Mesh& mesh = chunk.mesh;
  const auto invalid = [](const char* what) {
    return Error{Error::Cause::invalid, std::string("chunk cannot be drawn: ") + what};
  };
  if (!chunk.colors.empty() && chunk.colors.size() != mesh.positions.size())
    return invalid("it has colours for some of its vertices only");
  for (const ViewRun& run : mesh.runs)
    if (std::uint64_t{run.first} + run.count > mesh.triangles.size())
      return invalid("a view run ends after the last triangle");
  for (const Triangle& triangle : mesh.triangles)
    for (const std::uint32_t vertex : triangle)
      if (vertex >= mesh.positions.size())
        return invalid("a triangle names a vertex it does not have");
  return {};
}

}  // namespace

Result<SceneGeometry> gather(const DecodedScene& scene, Vec3d eye) {
  SceneGeometry out;
  std::map<RangeKey, std::size_t> sizes;
  std::size_t vertices = 0;
  for (const auto& chunk : scene.chunks) {
    if (auto ok = check(*chunk); !ok) return ok.error();
    for (const ViewRun& run : runs_of(*chunk))
      sizes[{run.view, !chunk->colors.empty()}] += 3 * std::size_t{run.count};
    vertices += chunk->mesh.positions.size();
  }
  if (vertices > 0xFFFFFFFFu) return Error{Error::Cause::too_large, "scene has over 2^32 vertices"};

  std::size_t total = 0;
  std::map<RangeKey, std::size_t> next;
  for (const auto& [key, size] : sizes) {
    if (size > 0) out.ranges.push_back({key.first, key.second, total, size});
    next[key] = total;
    total += size;
  }
  out.positions.reserve(vertices);
  out.indices.resize(total);
  for (const auto& chunk : scene.chunks) {
    const Mesh& mesh = chunk->mesh;
    const auto base = static_cast<std::uint32_t>(out.positions.size());
    for (const Vec3f p : mesh.positions)
      out.positions.push_back(vec_cast<float>(vec_cast<double>(p) - eye));
    for (const ViewRun& run : runs_of(*chunk)) {
      std::size_t& at = next[{run.view, !chunk->colors.empty()}];
      for (std::uint32_t t = run.first; t < run.first + run.count; ++t)
        for (const std::uint32_t vertex : mesh.triangles[t]) out.indices[at++] = base + vertex;
    }
  }
  out.colors = gather_colors(scene);
  return out;
}

}  // namespace mr::render
