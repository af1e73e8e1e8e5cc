#include "mr/merge/ownership.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/kit/raster.h"
#include "mr/kit/topology.h"
#include "mr/merge/cutter.h"
#include "mr/merge/part_field.h"
#include "mr/merge/part_view.h"
#include "mr/merge/patches.h"
#include "mr/merge/ray_grids.h"

namespace mr::merge {
namespace {

constexpr std::size_t kBlock = 512;    // vertices whose views are chosen together
constexpr float kFirstWins = 1.001f;   // of two about equally good measurements
constexpr float kSpotOfNobody = -1;    // quality of no rival
constexpr double kFocal_voxels = 2.5;  // pixels per radian · voxel_m: 1.2 voxels a pixel at 3 m
constexpr double kMostPatch_m2 = 0.02;
constexpr double kLeastFocal_px = 250;
constexpr double kPatch_voxels2 = 100;   // smaller patches are given up
constexpr float kRetreat_voxels = 0.2f;  // from an owner's border, on both sides
constexpr int kCutSteps = 4;
constexpr double kLongest_voxels = 10;  // of an edge where owners change
constexpr int kMaxCuts = 6;             // halvings of an edge

FieldVertex between(const FieldVertex& a, const FieldVertex& b, float t) {
  return {a.position + (b.position - a.position) * t, a.quality + (b.quality - a.quality) * t,
          a.normal + (b.normal - a.normal) * t, a.sigma_m + (b.sigma_m - a.sigma_m) * t};
}

/// The pinholes that a source looks through, as coarse as ownership needs.
std::vector<RayGrid> places_of(const SourceInfo& source, double voxel_m) {
  const double focal_px = std::max(kFocal_voxels / voxel_m, kLeastFocal_px);
  const Camera& camera = source.depth_camera;
  if (camera.model == CameraModel::pinhole)
    return {{scaled(camera, std::min(1.0, focal_px / camera.fx)), source.T_world_depth}};
  std::vector<RayGrid> out;
  for (const kit::CubeFace& face : kit::cube_faces(focal_px, 0))
    out.push_back({face.camera, source.T_world_depth * Pose{face.R_camera_face, {}}});
  return out;
}

/// Calls work(i) for every i below `count`, in parallel.
template <typename Work>
void for_each_index(std::size_t count, Work&& work) {
  parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) work(i);
  });
}

/// The parts of a merge, and who owns what of them.
class Ownership {
 public:
  Ownership(std::span<const Part> parts, const OverlapConfig& config)
      : parts_(parts),
        config_(config),
        fields_(parts.size()),
        surfaces_(parts.size()),
        owned_(parts.size()) {
    for (std::size_t i = 0; i < parts.size(); ++i) surfaces_[i].mesh = &parts[i].mesh;
    for_each_index(parts.size(), [&](std::size_t i) { fields_[i] = part_field(parts[i], config); });
    draw_views();
  }

  std::vector<Mesh> run() {
    compare();
    for_each_index(parts_.size(), [&](std::size_t i) { refine(static_cast<std::uint32_t>(i)); });
    give_up_patches();
    restore_orphans();
    std::vector<Mesh> out(parts_.size());
    for_each_index(parts_.size(), [&](std::size_t i) { out[i] = cut(i); });
    return out;
  }

 private:
  struct View {
    std::uint32_t part;
    PartView view;
  };
  /// A part while it is cut finer: at first its own mesh.
  struct Surface {
    const Mesh* mesh = nullptr;
    Mesh own_mesh{};
    std::vector<FieldVertex> own_vertices{};
    std::vector<std::uint32_t> whole{};  // [T] triangle of the part; empty: the same

    const std::vector<FieldVertex>& vertices(const PartField& field) const {
      return own_vertices.empty() ? field.vertices : own_vertices;
    }
  };
  using Rivals = std::vector<const View*>;

  void draw_views() {
    struct Wanted {
      std::uint32_t part, source;
      RayGrid place;
    };
    std::vector<Wanted> wanted;
    for (std::uint32_t i = 0; i < parts_.size(); ++i)
      for (std::uint32_t s = 0; s < parts_[i].sources.size(); ++s)
        for (RayGrid& place : places_of(parts_[i].sources[s], config_.voxel_m))
          wanted.push_back({i, s, std::move(place)});
    std::vector<std::optional<View>> drawn(wanted.size());
    for_each_index(wanted.size(), [&](std::size_t w) {
      const auto& [part, source, place] = wanted[w];
      const bool pinhole = parts_[part].sources[source].depth_camera.model == CameraModel::pinhole;
      const int margin_px = pinhole ? place.camera.width / 4 : 1;
      drawn[w].emplace(part, PartView(parts_[part], fields_[part], source, place.camera,
                                      place.T_world_camera, margin_px));
    });
    for (auto& view : drawn) views_.push_back(*std::move(view));
  }

  /// The views of other parts that may see something in a box.
  Rivals rivals_in(const Box3f& box, std::uint32_t part) const {
    Rivals out;
    for (const View& view : views_)
      if (view.part != part && view.view.may_see(box)) out.push_back(&view);
    return out;
  }

  /// How well the best rival measured a spot, and who that is.
  struct Best {
    float quality = kSpotOfNobody;
    Loss to;
  };
  Best best_rival(const FieldVertex& spot, std::uint32_t part, const Rivals& rivals) const {
    Best best;
    for (const View* r : rivals) {
      const auto rival = r->view.at(spot, fields_[part].slack_m);
      if (!rival || owned_[r->part].is_given_up(rival->triangle)) continue;
      const float quality = rival->quality * (r->part < part ? kFirstWins : 1 / kFirstWins);
      if (quality > best.quality) best = {quality, {r->part, rival->triangle}};
    }
    return best;
  }

  /// Finds the owner at every vertex.
  void compare() {
    struct Block {
      std::uint32_t part;
      std::size_t begin, end;
    };
    std::vector<Block> blocks;
    for (std::uint32_t i = 0; i < parts_.size(); ++i) {
      const std::size_t count = fields_[i].vertices.size();
      owned_[i].margin.resize(count), owned_[i].loss.resize(count);
      for (std::size_t b = 0; b < count; b += kBlock)
        blocks.push_back({i, b, std::min(b + kBlock, count)});
    }
    for_each_index(blocks.size(), [&](std::size_t k) {
      const auto& [part, begin, end] = blocks[k];
      Box3f box;
      for (std::size_t v = begin; v < end; ++v) box.add(fields_[part].vertices[v].position);
      const Rivals rivals = rivals_in(box, part);
      for (std::size_t v = begin; v < end; ++v) decide(part, v, rivals);
    });
  }

  void decide(std::uint32_t part, std::size_t vertex, const Rivals& rivals) {
    const FieldVertex& spot = surfaces_[part].vertices(fields_[part])[vertex];
    const Best best = best_rival(spot, part, rivals);
    owned_[part].margin[vertex] = spot.quality - best.quality;
    owned_[part].loss[vertex] = best.to;
  }

  /// Cuts long edges of triangles that are owned in part, so that a border between owners bends
  /// where it has to.
  void refine(std::uint32_t part) {
    const auto longest_m = static_cast<float>(kLongest_voxels * config_.voxel_m);
    const Rivals rivals = rivals_in(fields_[part].box, part);
    for (int round = 0; round < kMaxCuts && !rivals.empty(); ++round) {
      Surface& surface = surfaces_[part];
      std::vector<std::uint8_t> split(surface.mesh->triangles.size() * 3, 0);
      bool any = false;
      for (std::uint32_t t = 0; t < surface.mesh->triangles.size(); ++t) {
        const std::uint8_t edges = long_edges(*surface.mesh, t, longest_m);
        if (edges == 0 || !is_divided(part, t, rivals)) continue;
        for (int i = 0; i < 3; ++i) split[3 * t + i] = edges >> i & 1;
        any = true;
      }
      if (!any) return;
      split_edges(part, split, rivals);
    }
  }

  static std::uint8_t long_edges(const Mesh& mesh, std::uint32_t t, float longest_m) {
    std::uint8_t out = 0;
    for (int i = 0; i < 3; ++i)
      if (length(mesh.corner(t, i) - mesh.corner(t, (i + 1) % 3)) > longest_m)
        out |= static_cast<std::uint8_t>(1u << i);
    return out;
  }

  /// Whether a triangle's corners, middle and middles of its edges have different owners.
  bool is_divided(std::uint32_t part, std::uint32_t t, const Rivals& rivals) const {
    const auto& [a, b, c] = surfaces_[part].mesh->triangles[t];
    const std::vector<float>& margin = owned_[part].margin;
    const bool own = margin[a] > 0;
    if ((margin[b] > 0) != own || (margin[c] > 0) != own) return true;
    const auto differs = [&](const FieldVertex& spot) {
      return (spot.quality > best_rival(spot, part, rivals).quality) != own;
    };
    const std::vector<FieldVertex>& v = surfaces_[part].vertices(fields_[part]);
    const FieldVertex ab = between(v[a], v[b], 0.5f);
    return differs(ab) || differs(between(v[b], v[c], 0.5f)) ||
           differs(between(v[c], v[a], 0.5f)) || differs(between(ab, v[c], 1.0f / 3));
  }

  void split_edges(std::uint32_t part, const std::vector<std::uint8_t>& split,
                   const Rivals& rivals) {
    Surface& surface = surfaces_[part];
    kit::Refined fine = kit::refine(*surface.mesh, split);
    std::vector<std::uint32_t> whole;
    for (const std::uint32_t parent : fine.parent)
      whole.push_back(surface.whole.empty() ? parent : surface.whole[parent]);
    std::vector<FieldVertex> vertices = surface.vertices(fields_[part]);
    for (const auto& [a, b] : fine.cut_edges)
      vertices.push_back(between(vertices[a], vertices[b], 0.5f));
    surface.own_mesh = std::move(fine.mesh), surface.mesh = &surface.own_mesh;
    surface.whole = std::move(whole), surface.own_vertices = std::move(vertices);
    const std::size_t old = owned_[part].margin.size();
    owned_[part].margin.resize(surface.own_vertices.size());
    owned_[part].loss.resize(surface.own_vertices.size());
    for (std::size_t v = old; v < surface.own_vertices.size(); ++v) decide(part, v, rivals);
  }

  /// Small patches change hands: their owners give them up, and who lost to those decides anew.
  void give_up_patches() {
    const double voxel_m2 = config_.voxel_m * config_.voxel_m;
    const double least_m2 = std::min(kPatch_voxels2 * voxel_m2, kMostPatch_m2);
    std::vector<std::uint8_t> any(parts_.size());
    // One part after another: who gives up a spot must leave it to one that does not.
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const auto keeps = [&](const Loss& loss) {
        return loss.part != Loss::kNobody && !owned_[loss.part].is_given_up(loss.triangle);
      };
      const Surface& surface = surfaces_[i];
      any[i] = merge::give_up_patches(*surface.mesh, surface.whole, parts_[i].mesh.triangles.size(),
                                      least_m2, keeps, owned_[i]);
    }
    for_each_index(parts_.size(), [&](std::size_t i) {
      const auto part = static_cast<std::uint32_t>(i);
      std::vector<std::size_t> anew;
      for (std::size_t v = 0; v < owned_[i].loss.size(); ++v) {
        const Loss& loss = owned_[i].loss[v];
        if (loss.part != Loss::kNobody && any[loss.part] &&
            owned_[loss.part].is_given_up(loss.triangle) && !owned_[i].is_vertex_given_up(v))
          anew.push_back(v);
      }
      if (anew.empty()) return;
      const Rivals rivals = rivals_in(fields_[i].box, part);
      for (const std::size_t v : anew) decide(part, v, rivals);
    });
  }

  /// Whether a part keeps any of one of its triangles.
  bool keeps(const Loss& loss) const {
    const Owned& owned = owned_[loss.part];
    const auto& [a, b, c] = parts_[loss.part].mesh.triangles[loss.triangle];
    return !owned.is_given_up(loss.triangle) &&
           (owned.margin[a] > 0 || owned.margin[b] > 0 || owned.margin[c] > 0);
  }

  /// Removal makes no holes: what was lost to a part that lost it, too, comes back, unless a third
  /// one keeps it. One part after another, so that only one of them has it back.
  void restore_orphans() {
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      Owned& owned = owned_[i];
      const auto part = static_cast<std::uint32_t>(i);
      const Rivals rivals = rivals_in(fields_[i].box, part);
      const std::vector<FieldVertex>& vertices = surfaces_[i].vertices(fields_[i]);
      for (std::size_t v = 0; v < vertices.size(); ++v) {
        const Loss& loss = owned.loss[v];
        if (owned.margin[v] > 0 || loss.part == Loss::kNobody || keeps(loss)) continue;
        const bool kept_by_another = std::ranges::any_of(rivals, [&](const View* r) {
          const auto rival = r->view.at(vertices[v], fields_[i].slack_m);
          return rival && keeps({r->part, rival->triangle});
        });
        if (!kept_by_another) owned.margin[v] = std::max(-owned.margin[v], 1e-3f);
      }
    }
  }

  /// Cuts a part where its margin is zero: found between two vertices by looking there.
  Mesh cut(std::size_t i) const {
    const auto part = static_cast<std::uint32_t>(i);
    const std::vector<FieldVertex>& vertices = surfaces_[i].vertices(fields_[i]);
    const Rivals rivals = rivals_in(fields_[i].box, part);
    const auto margin_at = [&](std::uint32_t a, std::uint32_t b, float t) {
      const FieldVertex spot = between(vertices[a], vertices[b], t);
      return spot.quality - best_rival(spot, part, rivals).quality;
    };
    const float retreat_m = kRetreat_voxels * static_cast<float>(config_.voxel_m);
    const auto crossing = [&](std::uint32_t kept, std::uint32_t lost) {
      float low = 0, high = 1, at_low = owned_[i].margin[kept], at_high = owned_[i].margin[lost];
      const auto guess = [&] { return low + (high - low) * (at_low / (at_low - at_high)); };
      for (int k = 0; k < kCutSteps; ++k) {  // halving by turns: the margin may jump
        const float t = k % 2 == 0 ? guess() : (low + high) / 2, f = margin_at(kept, lost, t);
        (f > 0 ? low : high) = t, (f > 0 ? at_low : at_high) = f;
      }
      const float edge_m = length(vertices[lost].position - vertices[kept].position);
      return std::max(guess() - retreat_m / edge_m, 0.0f);
    };
    return cut_at_zero(*surfaces_[i].mesh, owned_[i].margin, crossing);
  }

  std::span<const Part> parts_;
  const OverlapConfig& config_;
  std::vector<PartField> fields_;
  std::vector<Surface> surfaces_;
  std::vector<View> views_;
  std::vector<Owned> owned_;
};

}  // namespace

std::vector<Mesh> best_measured(std::span<const Part> parts, const OverlapConfig& config) {
  return Ownership(parts, config).run();
}

}  // namespace mr::merge
