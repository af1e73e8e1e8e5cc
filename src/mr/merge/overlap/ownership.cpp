#include "mr/merge/overlap/ownership.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/kit/raster.h"
#include "mr/kit/topology.h"
#include "mr/merge/overlap/cutter.h"
#include "mr/merge/overlap/measured.h"
#include "mr/merge/overlap/part_view.h"
#include "mr/merge/overlap/quality_grid.h"
#include "mr/merge/overlap/ray_grids.h"

namespace mr::merge {
namespace {

constexpr std::size_t kVerticesAtOnce = 2048;  // vertices per parallel task
constexpr double kCell_voxels = 16;            // of the quality grid
constexpr float kFirstWins = 1.001f;           // of two about equally good measurements
constexpr float kClear = 0.8f;         // of another's quality: worse than that beside it, too
constexpr double kFocal_voxels = 2.5;  // pixels per radian · voxel_m: 1.2 voxels a pixel at 3 m
constexpr double kLeastFocal_px = 250;
constexpr float kRetreat_voxels = 0.8f;  // from an owner's border, on both sides
constexpr int kCutSteps = 4;
constexpr double kLongest_voxels = 10;  // of an edge where owners change
constexpr int kMaxOwnerCuts = 6;        // halvings of an edge

SurfacePoint between(const SurfacePoint& a, const SurfacePoint& b, float t) {
  return {a.position + (b.position - a.position) * t,
          normalized(a.normal + (b.normal - a.normal) * t), a.sigma_m + (b.sigma_m - a.sigma_m) * t,
          t < 0.5f ? a.source : b.source};
}

/// The pinhole cameras of a source (one, or the faces of a cube) at the low resolution that
/// ownership needs.
std::vector<RayGrid> places_of(const SourceInfo& source, double voxel_m) {
  const double focal_px = std::max(kFocal_voxels / voxel_m, kLeastFocal_px);
  const Camera& camera = source.depth_camera;
  if (camera.model == CameraModel::pinhole)
    return {{kit::scaled(camera, std::min(1.0, focal_px / camera.fx)), source.T_world_depth}};
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

std::vector<Measured> all_measured(std::span<const kit::Part> parts, const OverlapConfig& config) {
  std::vector<Measured> out(parts.size());
  for_each_index(parts.size(), [&](std::size_t i) { out[i] = measured(parts[i], config); });
  return out;
}

/// Identifies a triangle of a part.
struct TriangleId {
  std::uint32_t part = 0, triangle = 0;
};

/// The better owner of a point that its part does not own.
struct LostVertex {
  static constexpr std::uint32_t kNoOwner = 0xFFFFFFFFu;
  TriangleId to;
  std::uint32_t owner = kNoOwner;  ///< its number, as QualityGrid::Candidate has it
  bool is_clear = false;           ///< it measured the point better by far
};

/// A part's quality at one of its points minus the best quality of another part with surface there
/// (positive: the part owns the point), and that other part.
struct OwnershipMargin {
  float margin = 0;
  LostVertex loss;
};

/// The owner of every point of the surface: of the parts with surface there, the one that measured
/// it best.
class OwnershipMap {
 public:
  OwnershipMap(std::span<const kit::Part> parts, const OverlapConfig& config, QualityMemory* memory)
      : parts_(parts),
        measured_(all_measured(parts, config)),
        grid_(parts, measured_, kCell_voxels * config.voxel_m, memory, !config.is_piece) {
    struct Wanted {
      std::uint32_t part, source;
      std::size_t owner;
      RayGrid place;
    };
    std::vector<Wanted> wanted;
    for (std::uint32_t i = 0; i < parts.size(); ++i)
      for (std::uint32_t s = 0; s < parts[i].sources.size(); ++s, views_.emplace_back())
        for (RayGrid& place : places_of(parts[i].sources[s], config.voxel_m))
          wanted.push_back({i, s, views_.size(), std::move(place)});
    std::vector<std::optional<PartView>> drawn(wanted.size());
    for_each_index(wanted.size(), [&](std::size_t w) {
      const auto& [part, source, owner, place] = wanted[w];
      const bool pinhole = parts[part].sources[source].depth_camera.model == CameraModel::pinhole;
      drawn[w].emplace(parts[part], measured_[part], source, place.camera, place.T_world_camera,
                       pinhole ? place.camera.width / 4 : 1);
    });
    for (std::size_t w = 0; w < wanted.size(); ++w)
      views_[wanted[w].owner].push_back(*std::move(drawn[w]));
  }

  const Mesh& mesh(std::size_t part) const { return parts_[part].mesh; }
  const std::vector<SurfacePoint>& vertices(std::size_t part) const {
    return measured_[part].vertices;
  }
  /// The sensor that measured a triangle of a part.
  SensorId sensor(std::size_t part, std::uint32_t triangle) const {
    return parts_[part].sources[measured_[part].source[triangle]].sensor;
  }

  /// Finds the owners of points of one part; fastest when successive points are near each other.
  class OwnershipQuery {
   public:
    OwnershipQuery(const OwnershipMap& owners, std::size_t part)
        : owners_(owners), part_(static_cast<std::uint32_t>(part)), reader_(owners.grid_) {}

    /// The margin at a point of the part.
    OwnershipMargin margin_at(const SurfacePoint& point) {
      const auto candidates = reader_.at(point.position, point.normal);
      float mine = 0, below = 0;  // the best of those that measured it worse
      for (const auto& [owner, number, quality] : candidates)
        if (owner.part == part_ && owner.source == point.source) mine = quality;
      better_.clear();
      for (QualityGrid::Candidate its : candidates) {
        if (its.owner.part == part_) continue;
        its.quality *= its.owner.part < part_ ? kFirstWins : 1 / kFirstWins;
        if (its.quality < mine || (its.quality == mine && part_ < its.owner.part))
          below = std::max(below, its.quality);
        else
          better_.push_back(its);
      }
      std::ranges::make_heap(better_, {}, by_quality);
      for (; !better_.empty(); better_.pop_back()) {
        std::ranges::pop_heap(better_, {}, by_quality);
        const auto& [owner, number, quality] = better_.back();
        if (const auto t = owners_.find(number, point, part_))
          return {std::min(mine - quality, -kLeast),
                  {{owner.part, *t}, number, mine < kClear * quality}};
      }
      return {std::max(mine - below, kLeast), {}};
    }
    float margin(const SurfacePoint& point) { return margin_at(point).margin; }

    /// Whether a point is clearly lost to the same owner as a point beside it, which spares a
    /// query.
    bool is_lost_like(const LostVertex& beside, const SurfacePoint& point) const {
      return beside.is_clear && owners_.find(beside.owner, point, part_);
    }

    /// Whether another part has a triangle at a point that satisfies `holds(triangle)`.
    template <typename Holds>
    bool any_other_part(const SurfacePoint& point, Holds&& holds) {
      const auto candidates = reader_.at(point.position, point.normal);
      return std::ranges::any_of(candidates, [&](const QualityGrid::Candidate& c) {
        if (c.owner.part == part_) return false;
        const auto t = owners_.find(c.number, point, part_);
        return t && holds(TriangleId{c.owner.part, *t});
      });
    }

   private:
    static constexpr float kLeast = 1e-12f;
    /// Ties go to the lower number.
    static std::pair<float, std::uint32_t> by_quality(const QualityGrid::Candidate& c) {
      return {c.quality, ~c.number};
    }

    const OwnershipMap& owners_;
    std::uint32_t part_;
    QualityGrid::Reader reader_;
    std::vector<QualityGrid::Candidate> better_;  // than the part, those not asked yet
  };

 private:
  /// The triangle of an owner at a point of part `of`.
  std::optional<std::uint32_t> find(std::uint32_t owner, const SurfacePoint& point,
                                    std::uint32_t of) const {
    for (const PartView& view : views_[owner])
      if (const auto t = view.at(point, measured_[of].slack_m)) return t;
    return std::nullopt;
  }

  std::span<const kit::Part> parts_;
  std::vector<Measured> measured_;
  QualityGrid grid_;
  std::vector<std::vector<PartView>> views_;  // [owners]
};

/// Computes the region of a part that it owns.
class PartOwnership {
 public:
  PartOwnership(const OwnershipMap& owners, std::size_t part, const OverlapConfig& config)
      : owners_(owners),
        part_(part),
        config_(config),
        mesh_(&owners.mesh(part)),
        vertices_(&owners.vertices(part)),
        margin_(vertices_->size()),
        loss_(vertices_->size()) {}

  void find_margins(std::size_t begin, std::size_t end) {
    OwnershipMap::OwnershipQuery query(owners_, part_);
    for (std::size_t v = begin; v < end; ++v) {
      const OwnershipMargin found = query.margin_at((*vertices_)[v]);
      margin_[v] = found.margin, loss_[v] = found.loss;
    }
  }

  /// Whether the part owns a corner of its triangle.
  bool keeps(std::uint32_t triangle) const {
    const auto& [a, b, c] = mesh_->triangles[triangle];
    return margin_[a] > 0 || margin_[b] > 0 || margin_[c] > 0;
  }

  /// Prevents holes: a vertex lost to a part that itself lost the place, as in gaps as narrow as a
  /// triangle, is restored unless a third part keeps it.
  void restore(const std::vector<PartOwnership>& all) {
    std::optional<OwnershipMap::OwnershipQuery> query;
    const auto kept = [&](const TriangleId& place) {
      return all[place.part].keeps(place.triangle);
    };
    for (std::size_t v = 0; v < margin_.size(); ++v) {
      if (loss_[v].owner == LostVertex::kNoOwner || kept(loss_[v].to)) continue;
      if (!query) query.emplace(owners_, part_);
      if (!query->any_other_part((*vertices_)[v], kept)) margin_[v] = kRestored;
    }
  }

  /// Splits long edges of partly owned triangles, so that the border between owners can follow the
  /// quality function.
  void refine() {
    const auto longest_m = static_cast<float>(kLongest_voxels * config_.voxel_m);
    OwnershipMap::OwnershipQuery query(owners_, part_);
    for (int round = 0; round < kMaxOwnerCuts; ++round) {
      std::vector<std::uint8_t> split;
      for (std::uint32_t t = 0; t < mesh_->triangles.size(); ++t) {
        if (round > 0 && !is_new_[t]) continue;  // it was asked before
        const std::uint8_t edges = long_edges(t, longest_m);
        if (edges == 0 || !is_divided(t, query)) continue;
        split.resize(mesh_->triangles.size() * 3);
        for (int i = 0; i < 3; ++i) split[3 * t + i] = edges >> i & 1;
      }
      if (split.empty()) return;
      split_edges(split, query);
    }
  }

  /// The owned region: clips the mesh where the margin is zero. The zero on an edge is found by the
  /// secant method (regula falsi) and bisection in turn.
  Mesh cut() const {
    OwnershipMap::OwnershipQuery query(owners_, part_);
    const float retreat_m = kRetreat_voxels * static_cast<float>(config_.voxel_m);
    const auto crossing = [&](std::uint32_t kept, std::uint32_t lost) {
      const SurfacePoint &k = (*vertices_)[kept], &l = (*vertices_)[lost];
      if (margin_[kept] == kRestored) return 0.5f;
      float low = 0, high = 1, at_low = margin_[kept], at_high = margin_[lost];
      const auto guess = [&] { return low + (high - low) * (at_low / (at_low - at_high)); };
      for (int i = 0; i < kCutSteps; ++i) {  // halving by turns: the margin may jump
        const float t = i % 2 == 0 ? guess() : (low + high) / 2, m = query.margin(between(k, l, t));
        (m > 0 ? low : high) = t, (m > 0 ? at_low : at_high) = m;
      }
      return std::max(guess() - retreat_m / length(l.position - k.position), 0.0f);
    };
    Cut out = cut_at_zero(*mesh_, margin_, crossing);
    std::vector<SensorId> sensors;
    for (const std::uint32_t t : out.parent)
      sensors.push_back(owners_.sensor(part_, whole_.empty() ? t : whole_[t]));
    set_triangle_sensors(out.mesh, sensors);
    return std::move(out.mesh);
  }

 private:
  static constexpr float kRestored = std::numeric_limits<float>::max();

  std::uint8_t long_edges(std::uint32_t t, float longest_m) const {
    std::uint8_t out = 0;
    for (int i = 0; i < 3; ++i)
      if (length(mesh_->corner(t, i) - mesh_->corner(t, (i + 1) % 3)) > longest_m)
        out |= static_cast<std::uint8_t>(1u << i);
    return out;
  }

  /// Whether a triangle's corners, centroid and midpoint of its longest edge have different owners.
  bool is_divided(std::uint32_t t, OwnershipMap::OwnershipQuery& query) const {
    const Triangle& corners = mesh_->triangles[t];
    if (std::ranges::all_of(corners, [&](std::uint32_t v) { return margin_[v] == kRestored; }))
      return false;
    const bool own = margin_[corners[0]] > 0;
    if ((margin_[corners[1]] > 0) != own || (margin_[corners[2]] > 0) != own) return true;
    int longest = 0;
    std::array<float, 3> edges;
    for (int i = 0; i < 3; ++i) {
      edges[i] = length(mesh_->corner(t, i) - mesh_->corner(t, (i + 1) % 3));
      if (edges[i] > edges[longest]) longest = i;
    }
    const SurfacePoint& a = (*vertices_)[corners[longest]];
    const SurfacePoint& b = (*vertices_)[corners[(longest + 1) % 3]];
    const SurfacePoint& c = (*vertices_)[corners[(longest + 2) % 3]];
    const auto differs = [&](const SurfacePoint& point) {
      if (!own && std::ranges::any_of(corners, [&](std::uint32_t v) {
            return query.is_lost_like(loss_[v], point);
          }))
        return false;
      return (query.margin(point) > 0) != own;
    };
    const SurfacePoint middle = between(a, b, 0.5f);
    return differs(middle) || differs(between(middle, c, 1.0f / 3));
  }

  void split_edges(const std::vector<std::uint8_t>& split, OwnershipMap::OwnershipQuery& query) {
    kit::Refined fine = kit::refine(*mesh_, split);
    std::vector<SurfacePoint> vertices = *vertices_;
    for (const auto& [a, b] : fine.cut_edges) {
      vertices.push_back(between(vertices[a], vertices[b], 0.5f));
      const OwnershipMargin found = query.margin_at(vertices.back());
      margin_.push_back(found.margin), loss_.push_back(found.loss);
    }
    is_new_.resize(fine.parent.size());
    for (std::size_t t = 0; t < is_new_.size(); ++t)
      is_new_[t] = fine.mesh.triangles[t] != mesh_->triangles[fine.parent[t]];
    for (std::uint32_t& parent : fine.parent) parent = whole_.empty() ? parent : whole_[parent];
    whole_ = std::move(fine.parent);
    finer_mesh_ = std::move(fine.mesh), mesh_ = &finer_mesh_;
    finer_vertices_ = std::move(vertices), vertices_ = &finer_vertices_;
  }

  const OwnershipMap& owners_;
  std::size_t part_;
  const OverlapConfig& config_;
  const Mesh* mesh_;                           // the part's, or finer_mesh_
  const std::vector<SurfacePoint>* vertices_;  // of mesh_
  std::vector<float> margin_;                  // [V] of mesh_
  std::vector<LostVertex> loss_;               // [V] of mesh_
  std::vector<std::uint32_t> whole_;           // [T of mesh_] triangle of the part; empty: the same
  std::vector<std::uint8_t> is_new_;           // [T of mesh_] since edges were last split
  Mesh finer_mesh_;
  std::vector<SurfacePoint> finer_vertices_;
};

}  // namespace

std::vector<Mesh> best_measured(std::span<const kit::Part> parts, const OverlapConfig& config,
                                QualityMemory* memory) {
  const OwnershipMap owners(parts, config, memory);
  struct Block {
    std::size_t part, begin, end;
  };
  std::vector<PartOwnership> own;
  std::vector<Block> blocks;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    own.emplace_back(owners, i, config);
    const std::size_t count = owners.vertices(i).size();
    for (std::size_t b = 0; b < count; b += kVerticesAtOnce)
      blocks.push_back({i, b, std::min(b + kVerticesAtOnce, count)});
  }
  for_each_index(blocks.size(), [&](std::size_t b) {
    own[blocks[b].part].find_margins(blocks[b].begin, blocks[b].end);
  });
  for (PartOwnership& part : own) part.restore(own);  // one by one: only one of them has it back
  std::vector<Mesh> out(parts.size());
  for_each_index(parts.size(), [&](std::size_t i) {
    own[i].refine();
    out[i] = own[i].cut();
  });
  return out;
}

}  // namespace mr::merge
