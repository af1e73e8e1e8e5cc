#include "mr/node/cube_merger.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/node/chunk_grid.h"

namespace mr::node {
namespace {

/// A mesh whose triangles lie in some cubes or not.
struct Divided {
  Mesh inside, outside;
  std::vector<std::array<Vec3f, 2>> seam;  // edges between both, sorted

  Divided(const Mesh& mesh, double chunk_m, const std::set<Vec3i>& cubes) {
    std::vector<std::uint8_t> is_in(mesh.triangles.size()), is_out(mesh.triangles.size());
    std::vector<std::uint8_t> at_in(mesh.positions.size(), 0), at_out(mesh.positions.size(), 0);
    for (std::size_t t = 0; t < is_in.size(); ++t) {
      is_in[t] = cubes.contains(cube_of(vec_cast<double>(mesh.centroid(t)), chunk_m)),
      is_out[t] = !is_in[t];
      for (const std::uint32_t v : mesh.triangles[t]) (is_in[t] ? at_in : at_out)[v] = 1;
    }
    const auto at_seam = [&](std::uint32_t v) { return at_in[v] && at_out[v]; };
    for (std::size_t t = 0; t < is_in.size(); ++t)
      for (int i = 0; i < 3; ++i) {
        const std::uint32_t a = mesh.triangles[t][i], b = mesh.triangles[t][(i + 1) % 3];
        if (is_out[t] && at_seam(a) && at_seam(b))
          seam.push_back({mesh.positions[a], mesh.positions[b]});
      }
    std::ranges::sort(seam);
    inside = select_triangles(mesh, is_in), outside = select_triangles(mesh, is_out);
  }
};

}  // namespace

CubeMerger::CubeMerger(double chunk_m, double reach_m)
    : chunk_m_(chunk_m), rings_(static_cast<int>(std::ceil(reach_m / chunk_m))) {}

Mesh CubeMerger::run(const std::vector<DecodedScene>& scenes, const std::vector<kit::Part>& parts,
                     const Correct& correct, const Merge& merge) {
  Contents contents;
  for (std::size_t i = 0; i < scenes.size(); ++i)
    for (const auto& chunk : scenes[i].chunks)
      contents[chunk->key.id.cube].emplace_back(i, chunk.get());
  cubes_ = merged_ = contents.size();
  std::optional<Mesh> mesh;
  if (is_like_last(scenes)) {
    const Cubes again = grown(changed(contents));
    const auto is_merged = [&](const auto& cube) { return again.contains(cube.first); };
    const auto count = static_cast<std::size_t>(std::ranges::count_if(contents, is_merged));
    if (2 * count <= cubes_) mesh = mend(scenes, again, correct, merge);
    if (mesh) merged_ = count;
  }
  if (!mesh) mesh = merge(parts, true);
  last_ = Last{scenes, std::move(contents), *mesh};
  for (DecodedScene& scene : last_->scenes) scene.textures.clear();
  return *std::move(mesh);
}

bool CubeMerger::is_like_last(const std::vector<DecodedScene>& scenes) const {
  return last_ && std::ranges::equal(scenes, last_->scenes, [&](const auto& a, const auto& b) {
           return std::ranges::equal(a.sources, b.sources, same_place);
         });
}

CubeMerger::Cubes CubeMerger::changed(const Contents& contents) const {
  Cubes out;
  for (const auto& [cube, chunks] : contents) {
    const auto before = last_->contents.find(cube);
    if (before == last_->contents.end() || before->second != chunks) out.insert(cube);
  }
  for (const auto& [cube, chunks] : last_->contents)
    if (!contents.contains(cube)) out.insert(cube);
  return out;
}

/// With all cubes that are as near as a change can be felt.
CubeMerger::Cubes CubeMerger::grown(const Cubes& cubes) const {
  Cubes out;
  for (const Vec3i cube : cubes)
    for (int x = -rings_; x <= rings_; ++x)
      for (int y = -rings_; y <= rings_; ++y)
        for (int z = -rings_; z <= rings_; ++z) out.insert(cube + Vec3i{x, y, z});
  return out;
}

std::optional<Mesh> CubeMerger::mend(const std::vector<DecodedScene>& scenes, const Cubes& again,
                                     const Correct& correct, const Merge& merge) const {
  const Cubes around = grown(again);
  std::vector<kit::Part> parts(scenes.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      parts[i] = part_of(scenes[i], [&](Vec3i cube) { return around.contains(cube); });
  });
  correct(parts);
  const Divided fresh(merge(parts, false), chunk_m_, again);
  Divided old(last_->mesh, chunk_m_, again);
  if (fresh.seam != old.seam) return std::nullopt;
  append(old.outside, fresh.inside);
  return std::move(old.outside);
}

}  // namespace mr::node
