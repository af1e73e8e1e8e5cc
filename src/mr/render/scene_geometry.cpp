#include "mr/render/scene_geometry.h"

#include <map>
#include <string>

namespace mr::render {
namespace {

/// A mesh that is not labelled yet is one run without a view.
std::vector<ViewRun> runs_of(const Mesh& mesh) {
  if (!mesh.runs.empty()) return mesh.runs;
  return {{0, static_cast<std::uint32_t>(mesh.triangles.size()), kNoView}};
}

Status check(const Mesh& mesh) {
  const auto invalid = [](const char* what) {
    return Error{Error::Cause::invalid, std::string("chunk cannot be drawn: ") + what};
  };
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
  std::map<ViewId, std::size_t> sizes;
  std::size_t vertices = 0;
  for (const auto& chunk : scene.chunks) {
    if (auto ok = check(chunk->mesh); !ok) return ok.error();
    for (const ViewRun& run : runs_of(chunk->mesh)) sizes[run.view] += 3 * std::size_t{run.count};
    vertices += chunk->mesh.positions.size();
  }
  if (vertices > 0xFFFFFFFFu) return Error{Error::Cause::too_large, "scene has over 2^32 vertices"};

  std::size_t total = 0;
  std::map<ViewId, std::size_t> next;
  for (const auto& [view, size] : sizes) {
    if (size > 0) out.ranges.push_back({view, total, size});
    next[view] = total;
    total += size;
  }
  out.positions.reserve(vertices);
  out.indices.resize(total);
  for (const auto& chunk : scene.chunks) {
    const Mesh& mesh = chunk->mesh;
    const auto base = static_cast<std::uint32_t>(out.positions.size());
    for (const Vec3f p : mesh.positions)
      out.positions.push_back(vec_cast<float>(vec_cast<double>(p) - eye));
    for (const ViewRun& run : runs_of(mesh)) {
      std::size_t& at = next[run.view];
      for (std::uint32_t t = run.first; t < run.first + run.count; ++t)
        for (const std::uint32_t vertex : mesh.triangles[t]) out.indices[at++] = base + vertex;
    }
  }
  return out;
}

}  // namespace mr::render
