#include "mr/codec/background.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>

#include "mr/codec/gltf_model.h"
#include "mr/codec/mesh_codec.h"
#include "mr/codec/mip_chain.h"
#include "mr/core/file.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"

namespace mr::codec {
namespace {

constexpr std::size_t kMaxChunks = 32768;  // half of what a manifest may hold
constexpr int kMeshSpeed = 2;              // coded once, sent to everybody

/// A part of the model in the world.
struct Surface {
  Mesh mesh;
  std::vector<Vec2f> uvs;     ///< [V] or empty
  std::vector<Vec3f> colors;  ///< [V] linear, or empty
};

/// A mesh with linear colours, or with those that are sent.
template <typename Color>
struct Colored {
  Mesh mesh;
  std::vector<Color> colors;  ///< [V]
};
using Rgb = std::array<std::uint8_t, 3>;

Result<Surface> place(const ModelPart& part, const Pose& T_world_model, const Lattice& lattice) {
  Surface out{{}, part.uvs, part.colors};
  out.mesh.positions.reserve(part.positions.size());
  for (const Vec3d& p : part.positions) {
    const Vec3f world = vec_cast<float>(T_world_model * p);
    if (!is_finite(world) || !Lattice::contains(lattice.quantize(world)))
      return Error{Error::Cause::invalid,
                   "it reaches beyond the lattice of the scene; is T_world_model right?"};
    out.mesh.positions.push_back(world);
  }
  out.mesh.triangles = part.triangles;
  return out;
}

// --- cutting edges

/// Half-edges that are too long. Both triangles at an edge say the same, in one part or in two.
std::vector<std::uint8_t> long_edges(const Mesh& mesh, double max_edge_m) {
  std::vector<std::uint8_t> split(mesh.triangles.size() * 3);
  for (std::uint32_t h = 0; h < split.size(); ++h) {
    const Vec3f along =
        mesh.positions[kit::edge_to(mesh, h)] - mesh.positions[kit::edge_from(mesh, h)];
    split[h] = dot(along, along) > max_edge_m * max_edge_m;
  }
  return split;
}

template <typename T>
void add_midpoints(std::vector<T>& values, const kit::Refined& refined) {
  if (values.empty()) return;
  for (const auto& [a, b] : refined.cut_edges) values.push_back((values[a] + values[b]) * 0.5f);
}

/// Cuts a surface in rounds of halving. False when it gets more than `most` triangles.
bool cut_edges(Surface& surface, double max_edge_m, std::size_t most) {
  while (true) {
    const std::vector<std::uint8_t> split = long_edges(surface.mesh, max_edge_m);
    const auto cuts = static_cast<std::size_t>(std::count(split.begin(), split.end(), 1));
    if (surface.mesh.triangles.size() + cuts > most) return false;  // a cut edge is one more each
    if (cuts == 0) return true;
    kit::Refined refined = kit::refine(surface.mesh, split);
    add_midpoints(surface.uvs, refined);
    add_midpoints(surface.colors, refined);
    surface.mesh = std::move(refined.mesh);
  }
}

/// All surfaces; nothing when there are too many triangles.
std::optional<std::vector<Surface>> cut_edges(std::vector<Surface> surfaces, double max_edge_m) {
  std::size_t left = kMaxModelTriangles;
  for (Surface& surface : surfaces) {
    if (!cut_edges(surface, max_edge_m, left)) return std::nullopt;
    left -= surface.mesh.triangles.size();
  }
  return surfaces;
}

std::string in_cm(double length_m) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f cm", 100 * length_m);
  return text;
}

/// Cuts as finely as is wanted and possible. Snapping to the lattice may make an edge longer by a
/// step's diagonal, which is set aside.
std::vector<Surface> cut_within_limits(const std::vector<Surface>& surfaces, const Lattice& lattice,
                                       double max_edge_m, const Notice& notice) {
  const double aside = std::sqrt(3.0) * lattice.step_m();
  const double wanted = std::max(max_edge_m - aside, 0.5 * max_edge_m);
  double area_m2 = 0;
  for (const Surface& surface : surfaces) area_m2 += surface_area_m2(surface.mesh);
  // No triangle with such edges is larger than an equilateral one.
  const double hopeless = std::sqrt(area_m2 / (std::sqrt(3.0) / 4 * kMaxModelTriangles));
  for (double edge_m = std::max(wanted, hopeless);; edge_m *= 1.2) {
    auto fine = cut_edges(surfaces, edge_m);
    if (!fine) continue;
    if (edge_m > wanted && notice)
      notice("background: edges of up to " + in_cm(edge_m) + " instead of " + in_cm(max_edge_m) +
             ", to stay within 2 million triangles");
    return std::move(*fine);
  }
}

// --- colours

/// How many texels of the picture the edges at each vertex span on average.
std::vector<float> texels_per_edge(const Surface& surface, const ImageRgb& picture) {
  std::vector<float> sum(surface.uvs.size()), count(surface.uvs.size());
  for (const Triangle& t : surface.mesh.triangles)
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t a = t[i], b = t[(i + 1) % 3];
      const Vec2f d = surface.uvs[b] - surface.uvs[a];
      const float texels = std::hypot(d.x * static_cast<float>(picture.width),
                                      d.y * static_cast<float>(picture.height));
      for (const std::uint32_t v : {a, b}) sum[v] += texels, count[v] += 1;
    }
  for (std::size_t v = 0; v < sum.size(); ++v) sum[v] /= std::max(count[v], 1.0f);
  return sum;
}

/// The linear colour of each vertex: texture × factor × its own.
std::vector<Vec3f> paint(const Surface& surface, const ModelPart& part, const MipChain* mips) {
  std::vector<Vec3f> out(surface.mesh.positions.size(), part.factor);
  const auto times = [](Vec3f a, Vec3f b) { return Vec3f{a.x * b.x, a.y * b.y, a.z * b.z}; };
  const std::vector<float> texels =
      mips ? texels_per_edge(surface, mips->level(0)) : std::vector<float>{};
  parallel_for(out.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      if (mips) out[v] = times(out[v], mips->sample(surface.uvs[v], part.wrap, texels[v]));
      if (!surface.colors.empty()) out[v] = times(out[v], surface.colors[v]);
    }
  });
  return out;
}

/// Paints all surfaces and puts them into one mesh, unwelded.
Colored<Vec3f> paint_all(const std::vector<Surface>& surfaces, Model& model) {
  std::map<std::size_t, MipChain> mips;
  Colored<Vec3f> out;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const ModelPart& part = model.parts[i];
    const MipChain* chain = nullptr;
    if (part.picture) {
      const auto [at, is_new] = mips.try_emplace(*part.picture);
      if (is_new) at->second = MipChain(std::move(model.pictures[*part.picture]));
      chain = &at->second;
    }
    const std::vector<Vec3f> colors = paint(surfaces[i], part, chain);
    append(out.mesh, surfaces[i].mesh);
    out.colors.insert(out.colors.end(), colors.begin(), colors.end());
  }
  return out;
}

/// Puts the mesh on the lattice; vertices that meet there get the mean of their colours.
Result<Colored<Rgb>> snap(const Colored<Vec3f>& in, const Lattice& lattice) {
  auto snapped = snap_vertices(in.mesh, lattice);
  if (!snapped) return snapped.error();
  Colored<Rgb> out{std::move(snapped->mesh), {}};
  std::vector<Vec3f> sum(out.mesh.positions.size());
  std::vector<float> count(sum.size());
  for (std::size_t v = 0; v < in.colors.size(); ++v) {
    const std::uint32_t to = snapped->vertex_of[v];
    if (to != Snapped::kGone) sum[to] += in.colors[v], count[to] += 1;
  }
  out.colors.reserve(sum.size());
  for (std::size_t v = 0; v < sum.size(); ++v) out.colors.push_back(to_srgb(sum[v] / count[v]));
  return out;
}

// --- chunks

/// The triangles by the cube that holds their centroid.
std::map<Vec3i, std::vector<std::uint32_t>> by_cube(const Mesh& mesh, double chunk_m) {
  const auto cell = [&](float v) { return static_cast<std::int32_t>(std::floor(v / chunk_m)); };
  std::map<Vec3i, std::vector<std::uint32_t>> out;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f c = mesh.centroid(t);
    out[{cell(c.x), cell(c.y), cell(c.z)}].push_back(t);
  }
  return out;
}

std::vector<Chunk> split(const Colored<Rgb>& in, double chunk_m) {
  std::vector<Chunk> out;
  std::vector<std::uint32_t> number(in.mesh.positions.size()), chunk_of(number.size());
  for (const auto& [cube, triangles] : by_cube(in.mesh, chunk_m)) {
    Chunk& chunk = out.emplace_back();
    chunk.key = {{cube, kBackgroundSource}, 0, 1};
    for (const std::uint32_t t : triangles) {
      Triangle triangle = in.mesh.triangles[t];
      for (std::uint32_t& v : triangle) {
        if (chunk_of[v] != out.size()) {
          chunk_of[v] = static_cast<std::uint32_t>(out.size());
          number[v] = static_cast<std::uint32_t>(chunk.mesh.positions.size());
          chunk.mesh.positions.push_back(in.mesh.positions[v]);
          chunk.colors.push_back(in.colors[v]);
        }
        v = number[v];
      }
      chunk.mesh.triangles.push_back(triangle);
    }
  }
  return out;
}

Result<std::vector<EncodedChunk>> encode(const std::vector<Chunk>& chunks, const Lattice& lattice) {
  if (chunks.empty()) return Error{Error::Cause::empty, "it has no triangles"};
  if (chunks.size() > kMaxChunks)
    return Error{Error::Cause::too_large, "it fills " + std::to_string(chunks.size()) +
                                              " cubes, at most " + std::to_string(kMaxChunks)};
  std::vector<std::optional<Result<EncodedChunk>>> coded(chunks.size());
  parallel_for(chunks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      coded[i] = encode_chunk(chunks[i], lattice, kMeshSpeed);
  });
  std::vector<EncodedChunk> out;
  for (auto& chunk : coded) {
    if (!chunk->ok()) return chunk->error();
    out.push_back(**std::move(chunk));
  }
  return out;
}

}  // namespace

Result<std::vector<EncodedChunk>> load_background(const BackgroundConfig& config,
                                                  const Lattice& lattice, double chunk_m,
                                                  double max_edge_m, const Notice& notice) {
  const auto bytes = read_file(config.model, kMaxModelBytes);
  if (!bytes) return bytes.error();
  auto chunks =
      encode_background(*bytes, config.T_world_model, lattice, chunk_m, max_edge_m, notice);
  if (!chunks)
    return Error{chunks.error().cause, config.model.string() + ": " + chunks.error().message};
  return chunks;
}

Result<std::vector<EncodedChunk>> encode_background(std::span<const std::byte> glb,
                                                    const Pose& T_world_model,
                                                    const Lattice& lattice, double chunk_m,
                                                    double max_edge_m, const Notice& notice) {
  MR_ASSERT(chunk_m > 0 && max_edge_m > 0);
  auto model = read_glb(glb);
  if (!model) return model.error();
  std::vector<Surface> surfaces;
  for (const ModelPart& part : model->parts) {
    auto surface = place(part, T_world_model, lattice);
    if (!surface) return surface.error();
    surfaces.push_back(std::move(*surface));
  }
  surfaces = cut_within_limits(surfaces, lattice, max_edge_m, notice);
  const auto mesh = snap(paint_all(surfaces, *model), lattice);
  if (!mesh) return mesh.error();
  return encode(split(*mesh, chunk_m), lattice);
}

}  // namespace mr::codec
