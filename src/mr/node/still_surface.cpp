#include "mr/node/still_surface.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "mr/codec/mesh_codec.h"
#include "mr/core/hash.h"
#include "mr/core/parallel.h"
#include "mr/kit/hole_filling.h"
#include "mr/kit/topology.h"
#include "mr/merge/islands.h"
#include "mr/simplify/simplify.h"

namespace mr::node {
namespace {

constexpr double kStillPinhole_voxels = 12;  // perimeter: a hole left by a few pixels without depth
constexpr int kRingsAround = 2;              // of triangles that the border lines depend on

/// Hash of a chunk's input.
std::uint64_t hash_of(const Mesh& mesh, const std::vector<std::uint32_t>& chunk,
                      std::uint32_t own) {
  Hash hash;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    hash.add(chunk[t] == own);
    for (int i = 0; i < 3; ++i) hash.add(mesh.corner(t, i));
  }
  return hash.value();
}

/// [T] whether a triangle lies within kRingsAround rings around another chunk's triangles.
std::vector<std::uint8_t> near_lines(const Mesh& mesh, const std::vector<std::uint32_t>& chunk) {
  constexpr std::uint32_t kNone = 0xFFFFFFFFu;
  std::vector<std::uint32_t> of_vertex(mesh.positions.size(), kNone);
  std::vector<std::uint8_t> reached(mesh.positions.size()), near(mesh.triangles.size());
  for (std::size_t t = 0; t < near.size(); ++t)
    for (const std::uint32_t v : mesh.triangles[t]) {
      if (of_vertex[v] == kNone) of_vertex[v] = chunk[t];
      reached[v] |= of_vertex[v] != chunk[t];
    }
  for (int ring = 0; ring < kRingsAround; ++ring) {
    std::vector<std::uint32_t> fresh;
    for (std::uint32_t t = 0; t < near.size(); ++t) {
      const auto& [a, b, c] = mesh.triangles[t];
      if (!near[t] && (reached[a] | reached[b] | reached[c])) near[t] = 1, fresh.push_back(t);
    }
    for (const std::uint32_t t : fresh)
      for (const std::uint32_t v : mesh.triangles[t]) reached[v] = 1;
  }
  return near;
}

/// Removes connected components with an area below `least_m2` that do not continue in a neighbour.
Mesh without_small_parts(const Mesh& mesh, const std::vector<std::uint8_t>& on_line,
                         double least_m2) {
  const kit::Components parts = kit::components(mesh);
  std::vector<std::uint8_t> goes_on(parts.area_m2.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::uint32_t v : mesh.triangles[t]) goes_on[parts.of_triangle[t]] |= on_line[v];
  std::vector<std::uint8_t> keep(mesh.triangles.size());
  for (std::size_t t = 0; t < keep.size(); ++t)
    keep[t] = goes_on[parts.of_triangle[t]] || parts.area_m2[parts.of_triangle[t]] >= least_m2;
  return select_triangles(mesh, keep);
}

}  // namespace

StillSurface::StillSurface(const Scene& scene)
    : scene_(&scene),
      fuser_({.voxel_m = scene.voxel_m,
              .truncation_m = scene.fusion.truncation_m,
              .bounds = scene.volume,
              .chunk_m = scene.fusion.chunk_m,
              .history = fusion::History::none}) {}

/// Groups triangles by chunk. A triangle of a filled hole belongs to the first chunk, in their
/// order, that owns one of its vertices.
StillSurface::Labelled StillSurface::by_cube(const fusion::Surface& surface, const Mesh& mesh) {
  Labelled out{mesh, std::vector<std::uint32_t>(mesh.triangles.size()), {}, {}, {}};
  std::vector<std::uint32_t> of_vertex(mesh.positions.size());
  for (std::uint32_t c = 0; c < surface.pieces.size(); ++c) {
    const fusion::SurfacePiece& piece = surface.pieces[c];
    out.cubes.push_back(piece.cube);
    std::fill_n(of_vertex.begin() + piece.first_vertex, piece.vertices, c);
  }
  out.triangles.resize(out.cubes.size());
  std::uint32_t piece = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    while (piece < surface.pieces.size() &&
           t >= surface.pieces[piece].first_triangle + surface.pieces[piece].triangles)
      ++piece;
    const auto& [a, b, c] = mesh.triangles[t];
    out.chunk[t] = piece < surface.pieces.size()
                       ? piece
                       : std::min({of_vertex[a], of_vertex[b], of_vertex[c]});
    out.triangles[out.chunk[t]].push_back(t);
  }
  const std::vector<std::uint8_t> is_near = near_lines(mesh, out.chunk);
  out.near_lines.resize(out.cubes.size());
  for (std::uint32_t t = 0; t < is_near.size(); ++t)
    if (is_near[t]) out.near_lines[out.chunk[t]].push_back(t);
  return out;
}

/// The surface of a still picture, in the fuser's memory.
Result<fusion::Surface*> StillSurface::fuse(const ImageDepth& still, const Camera& camera,
                                            const Pose& T_world_camera,
                                            const Precision& precision) {
  fusion::IntegrateReport report;
  fusion::Surface& surface = fuser_.fuse({.depth = still,
                                          .camera = camera,
                                          .T_world_camera = T_world_camera,
                                          .region = {0, 0, still.width, still.height},
                                          .precision = precision,
                                          .slanted = true},
                                         &report);
  if (!report.usable)
    return Error{Error::Cause::invalid, "the still picture's camera or pose cannot be used"};
  kit::fill_small_holes(surface.mesh, kStillPinhole_voxels * scene_->voxel_m);
  return &surface;
}

Result<std::vector<StillChunk>> StillSurface::update(const ImageDepth& still, const Camera& camera,
                                                     const Pose& T_world_camera,
                                                     const Precision& precision, double error_m) {
  const auto surface = fuse(still, camera, T_world_camera, precision);
  if (!surface) return surface.error();
  const Labelled all = by_cube(**surface, (*surface)->mesh);

  std::vector<std::uint64_t> hashes(all.cubes.size());
  std::vector<std::optional<Result<StillChunk>>> made(all.cubes.size());
  parallel_for(hashes.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (auto c = static_cast<std::uint32_t>(begin); c < end; ++c) {
      const Part part = part_of(all, c);
      hashes[c] = hash_of(part.mesh, part.chunk, c);
      const auto before = fused_.find(all.cubes[c]);
      if (before == fused_.end() || before->second != hashes[c] || error_m != error_m_)
        made[c] = decimate(part, c, all.cubes[c], error_m);
    }
  });
  std::map<Vec3i, std::uint64_t> fused;
  for (std::size_t c = 0; c < hashes.size(); ++c) fused[all.cubes[c]] = hashes[c];
  std::vector<StillChunk> out;
  for (auto& chunk : made) {
    if (!chunk) continue;
    if (!chunk->ok()) return chunk->error();
    out.push_back(std::move(**chunk));
  }
  for (const auto& [cube, hash] : fused_)
    if (!fused.contains(cube)) out.push_back({cube, {}});
  std::ranges::sort(out, {}, &StillChunk::cube);
  fused_ = std::move(fused);
  error_m_ = error_m;
  return out;
}

StillSurface::Part StillSurface::part_of(const Labelled& all, std::uint32_t chunk) {
  const Mesh& mesh = all.mesh;
  constexpr std::uint32_t kNone = 0xFFFFFFFFu;
  std::vector<std::uint32_t> index(mesh.positions.size(), kNone);  // vertex → in the part
  Part out;
  const auto add = [&](std::uint32_t t) {
    Triangle& triangle = out.mesh.triangles.emplace_back(mesh.triangles[t]);
    for (std::uint32_t& v : triangle) {
      if (index[v] == kNone) {
        index[v] = static_cast<std::uint32_t>(out.mesh.positions.size());
        out.mesh.positions.push_back(mesh.positions[v]);
      }
      v = index[v];
    }
    out.chunk.push_back(all.chunk[t]);
  };
  for (const std::uint32_t t : all.triangles[chunk]) add(t);
  std::vector<std::uint32_t> around;  // triangles of the neighbours
  for (std::uint32_t c = 0; c < all.cubes.size(); ++c) {
    const Vec3i d = all.cubes[c] - all.cubes[chunk];
    if (c != chunk && std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)}) <= 1)
      around.insert(around.end(), all.near_lines[c].begin(), all.near_lines[c].end());
  }
  for (int ring = 0; ring < kRingsAround; ++ring) {
    const std::size_t known = out.mesh.positions.size();
    std::erase_if(around, [&](std::uint32_t t) {
      const bool touches =
          std::ranges::any_of(mesh.triangles[t], [&](std::uint32_t v) { return index[v] < known; });
      if (touches) add(t);
      return touches;
    });
  }
  return out;
}

Result<StillChunk> StillSurface::decimate(const Part& part, std::uint32_t chunk, Vec3i cube,
                                          double error_m) const {
  auto small =
      simplify::simplify(part.mesh, {.error_m = static_cast<float>(error_m), .chunks = part.chunk});
  if (!small) return small.error();
  std::vector<std::uint8_t> own(small->mesh.triangles.size()),
      on_line(small->mesh.positions.size());
  for (std::size_t t = 0; t < own.size(); ++t) {
    own[t] = small->chunks[t] == chunk;
    if (!own[t])
      for (const std::uint32_t v : small->mesh.triangles[t]) on_line[v] = 1;
  }
  std::vector<std::uint8_t> own_on_line;  // of the vertices that stay, in order of first use
  std::vector<std::uint8_t> seen(on_line.size());
  float own_error_m = 0;
  for (std::size_t t = 0; t < own.size(); ++t)
    if (own[t])
      for (const std::uint32_t v : small->mesh.triangles[t])
        if (!std::exchange(seen[v], std::uint8_t{1})) {
          own_on_line.push_back(on_line[v]);
          own_error_m = std::max(own_error_m, small->errors_m[v]);
        }
  Mesh whole = without_small_parts(select_triangles(small->mesh, own), own_on_line,
                                   merge::island_area_m2(scene_->voxel_m));
  auto snapped = codec::snap_to_lattice(whole, scene_->lattice);
  if (!snapped) return snapped.error();
  return StillChunk{cube, {kit::without_nonmanifold_edges(*snapped), own_error_m}};
}

}  // namespace mr::node
