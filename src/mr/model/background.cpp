#include "mr/model/background.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>

#include "mr/core/assert.h"
#include "mr/core/file.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/model/gltf_model.h"
#include "mr/model/mip_chain.h"

namespace mr::model {
namespace {

/// A part of the model in the world.
struct Surface {
  Mesh mesh;
  std::vector<Vec2f> uvs;     ///< [V] or empty
  std::vector<Vec3f> colors;  ///< [V] linear, or empty
};

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

/// Marks half-edges that are too long. Both triangles at an edge decide alike, also across parts.
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

/// Halves long edges in rounds. False: more than `most` triangles would result.
bool cut_edges(Surface& surface, double max_edge_m, std::size_t most) {
  while (true) {
    const std::vector<std::uint8_t> split = long_edges(surface.mesh, max_edge_m);
    const auto cuts = static_cast<std::size_t>(std::count(split.begin(), split.end(), 1));
    if (surface.mesh.triangles.size() + cuts > most) return false;  // each cut adds one triangle
    if (cuts == 0) return true;
    kit::Refined refined = kit::refine(surface.mesh, split);
    add_midpoints(surface.uvs, refined);
    add_midpoints(surface.colors, refined);
    surface.mesh = std::move(refined.mesh);
  }
}

/// Cuts the edges of all surfaces; nothing: too many triangles.
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
ColoredMesh paint_all(const std::vector<Surface>& surfaces, Model& model) {
  std::map<std::size_t, MipChain> mips;
  ColoredMesh out;
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

}  // namespace

std::vector<std::string> BackgroundConfig::problems() const {
  std::vector<std::string> out;
  if (model.extension() != ".glb") out.push_back("model must be a binary glTF file (.glb)");
  for (const double v : T_world_model.matrix())
    if (!std::isfinite(v)) return out.push_back("T_world_model must hold finite numbers"), out;
  return out;
}

Result<ColoredMesh> load_background(const BackgroundConfig& config, const Lattice& lattice,
                                    double max_edge_m, const Notice& notice) {
  const auto bytes = read_file(config.model, kMaxModelBytes);
  if (!bytes) return bytes.error();
  auto mesh = read_background(*bytes, config.T_world_model, lattice, max_edge_m, notice);
  if (!mesh) return Error{mesh.error().cause, config.model.string() + ": " + mesh.error().message};
  return mesh;
}

Result<ColoredMesh> read_background(std::span<const std::byte> glb, const Pose& T_world_model,
                                    const Lattice& lattice, double max_edge_m,
                                    const Notice& notice) {
  MR_ASSERT(max_edge_m > 0);
  auto model = read_glb(glb);
  if (!model) return model.error();
  std::vector<Surface> surfaces;
  for (const ModelPart& part : model->parts) {
    auto surface = place(part, T_world_model, lattice);
    if (!surface) return surface.error();
    surfaces.push_back(std::move(*surface));
  }
  surfaces = cut_within_limits(surfaces, lattice, max_edge_m, notice);
  return paint_all(surfaces, *model);
}

}  // namespace mr::model
