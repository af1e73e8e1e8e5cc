#include "mr/merge/overlap/ownership.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/merge/overlap/cutter.h"
#include "mr/merge/overlap/ownership_map.h"

namespace mr::merge {
namespace {

constexpr std::size_t kVerticesAtOnce = 2048;  // vertices per parallel task
constexpr float kRetreat_voxels = 0.8f;        // from an owner's border, on both sides
constexpr int kCutSteps = 4, kKeptSteps = 5;
constexpr double kLongest_voxels = 10;  // of an edge where owners change
constexpr int kMaxOwnerCuts = 6;        // halvings of an edge

SurfacePoint between(const SurfacePoint& a, const SurfacePoint& b, float t) {
  return {a.position + (b.position - a.position) * t,
          normalized(a.normal + (b.normal - a.normal) * t), a.sigma_m + (b.sigma_m - a.sigma_m) * t,
          t < 0.5f ? a.source : b.source};
}

/// Calls work(i) for every i below `count`, in parallel.
template <typename Work>
void for_each_index(std::size_t count, Work&& work) {
  parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) work(i);
  });
}

/// Calls work(i, begin, end) for blocks of [0, counts[i]) of every i, in parallel.
template <typename Work>
void for_each_block(const std::vector<std::size_t>& counts, Work&& work) {
  struct Block {
    std::size_t i, begin, end;
  };
  std::vector<Block> blocks;
  for (std::size_t i = 0; i < counts.size(); ++i)
    for (std::size_t b = 0; b < counts[i]; b += kVerticesAtOnce)
      blocks.push_back({i, b, std::min(b + kVerticesAtOnce, counts[i])});
  for_each_index(blocks.size(),
                 [&](std::size_t b) { work(blocks[b].i, blocks[b].begin, blocks[b].end); });
}

/// Computes the region of a part that it keeps, in two rounds:
///   claim()   what it measured best
///   settle()  that, and what it lost to parts that do not keep it either; without what parts
///             before it keep in that way
/// then level(), which moves what is kept to the mean of all parts.
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
    OwnershipMap::Query query(owners_, part_);
    for (std::size_t v = begin; v < end; ++v) {
      const OwnershipMargin found = query.margin_at((*vertices_)[v]);
      margin_[v] = found.margin, loss_[v] = found.loss;
    }
  }

  /// What the part measured best: its mesh where the margin is positive, a little less.
  Cut claim() {
    OwnershipMap::Query query(owners_, part_);
    keep_.resize(margin_.size());
    for (std::size_t v = 0; v < margin_.size(); ++v) keep_[v] = margin_[v] > 0;
    refine(query, Round::claim);
    Cut out = cut_at(*mesh_, keep_, [&](std::uint32_t kept, std::uint32_t lost) {
      return claim_end(kept, lost, query).cut;
    });
    for (std::uint32_t& parent : out.parent) parent = whole(parent);
    return out;
  }

  /// What the part keeps of its mesh for good. `also`: what it had not claimed of that.
  Mesh settle(Cut& also) {
    OwnershipMap::Query query(owners_, part_);
    settle_vertices();
    refine(query, Round::settle);
    Cut out = cut_at(*mesh_, keep_, [&](std::uint32_t kept, std::uint32_t lost) {
      return crossing(kept, lost, query);
    });
    std::vector<SensorId> sensors;
    for (std::uint32_t& parent : out.parent) {
      sensors.push_back(owners_.sensor(part_, whole(parent)));
      const auto& corners = mesh_->triangles[parent];
      if (std::ranges::any_of(corners,
                              [&](std::uint32_t v) { return margin_[v] <= 0 && keep_[v]; }))
        also.parent.push_back(whole(parent)),
            also.mesh.triangles.push_back(out.mesh.triangles[sensors.size() - 1]);
    }
    if (!also.parent.empty()) also.mesh.positions = out.mesh.positions;
    set_triangle_sensors(out.mesh, sensors);
    settled_ = std::move(out.places);
    return std::move(out.mesh);
  }

  /// Moves vertices of the settled mesh to the mean of all parts' surfaces.
  void level(std::size_t begin, std::size_t end, Mesh& mesh) const {
    OwnershipMap::Query query(owners_, part_);
    for (std::size_t v = begin; v < end; ++v) {
      const auto& [from, to, share] = settled_[v];
      mesh.positions[v] = query.mean_at(between((*vertices_)[from], (*vertices_)[to], share));
    }
  }

 private:
  /// The part's triangle that a triangle of mesh_ lies in.
  std::uint32_t whole(std::uint32_t t) const { return whole_.empty() ? t : whole_[t]; }

  enum class Round { claim, settle };

  static bool keeps(Round round, const SurfacePoint& point, const OwnershipMargin& own,
                    OwnershipMap::Query& query) {
    if (round == Round::claim) return own.margin > 0;
    return own.margin > 0 ? !query.is_kept_also(point) : !query.is_kept(point, own.loss);
  }

  void settle_vertices() {
    for_each_block({keep_.size()}, [&](std::size_t, std::size_t begin, std::size_t end) {
      OwnershipMap::Query query(owners_, part_);
      for (std::size_t v = begin; v < end; ++v)
        keep_[v] = keeps(Round::settle, (*vertices_)[v], {margin_[v], loss_[v]}, query);
    });
    is_new_.clear();
  }

  /// Where a claim ends on an edge, in shares of the way from its kept to its lost vertex.
  struct ClaimEnd {
    float line = 0;  ///< the margin is zero
    float cut = 0;   ///< a little before, which leaves the zipper a gap
    float next = 0;  ///< as much after: there another part's claim begins
  };
  /// The line by the secant method (regula falsi) and bisection in turn.
  ClaimEnd claim_end(std::uint32_t kept, std::uint32_t lost, OwnershipMap::Query& query) const {
    const SurfacePoint &k = (*vertices_)[kept], &l = (*vertices_)[lost];
    float low = 0, high = 1, at_low = margin_[kept], at_high = margin_[lost];
    const auto guess = [&] { return low + (high - low) * (at_low / (at_low - at_high)); };
    for (int i = 0; i < kCutSteps; ++i) {  // halving by turns: the margin may jump
      const float t = i % 2 == 0 ? guess() : (low + high) / 2, m = query.margin(between(k, l, t));
      (m > 0 ? low : high) = t, (m > 0 ? at_low : at_high) = m;
    }
    const float line = guess(), retreat_m = kRetreat_voxels * static_cast<float>(config_.voxel_m);
    const float retreat = retreat_m / length(l.position - k.position);
    return {line, std::max(line - retreat, 0.0f), std::min(line + retreat, 1.0f)};
  }

  /// Where the part's region ends on an edge: a little before the line of equal quality, if another
  /// part begins there; else where another part's begins.
  float crossing(std::uint32_t kept, std::uint32_t lost, OwnershipMap::Query& query) const {
    const SurfacePoint &k = (*vertices_)[kept], &l = (*vertices_)[lost];
    float low = 0, high = 1;
    if (margin_[kept] > 0 && margin_[lost] <= 0) {
      const ClaimEnd end = claim_end(kept, lost, query);
      if (query.is_kept(between(k, l, end.next), loss_[lost])) return end.cut;
      low = end.next;
    }
    for (int i = 0; i < kKeptSteps; ++i) {
      const float t = (low + high) / 2;
      const SurfacePoint point = between(k, l, t);
      const bool is_kept =
          margin_[lost] > 0 ? query.is_kept_also(point) : query.is_kept(point, loss_[lost]);
      (is_kept ? high : low) = t;
    }
    return low;
  }

  /// Splits long edges of triangles that are kept in part, so that the border can follow.
  void refine(OwnershipMap::Query& query, Round round) {
    const auto longest_m = static_cast<float>(kLongest_voxels * config_.voxel_m);
    for (int cut = 0; cut < kMaxOwnerCuts; ++cut) {
      std::vector<std::uint8_t> split;
      for (std::uint32_t t = 0; t < mesh_->triangles.size(); ++t) {
        if (cut > 0 && !is_new_[t]) continue;  // it was asked before
        const std::uint8_t edges = long_edges(t, longest_m);
        if (edges == 0 || !is_divided(t, query, round)) continue;
        split.resize(mesh_->triangles.size() * 3);
        for (int i = 0; i < 3; ++i) split[3 * t + i] = edges >> i & 1;
      }
      if (split.empty()) return;
      split_edges(split, query, round);
    }
  }

  std::uint8_t long_edges(std::uint32_t t, float longest_m) const {
    std::uint8_t out = 0;
    for (int i = 0; i < 3; ++i)
      if (length(mesh_->corner(t, i) - mesh_->corner(t, (i + 1) % 3)) > longest_m)
        out |= static_cast<std::uint8_t>(1u << i);
    return out;
  }

  /// Whether of a triangle's corners, centroid and midpoint of its longest edge some are kept.
  bool is_divided(std::uint32_t t, OwnershipMap::Query& query, Round round) const {
    const Triangle& corners = mesh_->triangles[t];
    const bool own = keep_[corners[0]] != 0;
    if ((keep_[corners[1]] != 0) != own || (keep_[corners[2]] != 0) != own) return true;
    int longest = 0;
    std::array<float, 3> edges;
    for (int i = 0; i < 3; ++i) {
      edges[i] = length(mesh_->corner(t, i) - mesh_->corner(t, (i + 1) % 3));
      if (edges[i] > edges[longest]) longest = i;
    }
    const SurfacePoint& a = (*vertices_)[corners[longest]];
    const SurfacePoint& b = (*vertices_)[corners[(longest + 1) % 3]];
    const SurfacePoint& c = (*vertices_)[corners[(longest + 2) % 3]];
    const auto claimed = std::ranges::count_if(corners, [&](auto v) { return margin_[v] > 0; });
    const auto differs = [&](const SurfacePoint& point) {
      if (round == Round::settle &&
          (claimed == 0 || claimed == 3))  // so is the point, since claim()
        return keeps(round, point, {margin_[corners[0]], loss_[corners[0]]}, query) != own;
      if (round == Round::claim && !own && std::ranges::any_of(corners, [&](std::uint32_t v) {
            return query.is_lost_like(loss_[v], point);
          }))
        return false;
      return keeps(round, point, query.margin_at(point), query) != own;
    };
    const SurfacePoint middle = between(a, b, 0.5f);
    return differs(middle) || differs(between(middle, c, 1.0f / 3));
  }

  void split_edges(const std::vector<std::uint8_t>& split, OwnershipMap::Query& query,
                   Round round) {
    kit::Refined fine = kit::refine(*mesh_, split);
    std::vector<SurfacePoint> vertices = *vertices_;
    for (const auto& [a, b] : fine.cut_edges) {
      vertices.push_back(between(vertices[a], vertices[b], 0.5f));
      const OwnershipMargin found = query.margin_at(vertices.back());
      margin_.push_back(found.margin), loss_.push_back(found.loss);
      keep_.push_back(keeps(round, vertices.back(), found, query));
    }
    is_new_.resize(fine.parent.size());
    for (std::size_t t = 0; t < is_new_.size(); ++t)
      is_new_[t] = fine.mesh.triangles[t] != mesh_->triangles[fine.parent[t]];
    for (std::uint32_t& parent : fine.parent) parent = whole(parent);
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
  std::vector<Loss> loss_;                     // [V] of mesh_
  std::vector<std::uint8_t> keep_;             // [V] of mesh_
  std::vector<std::uint32_t> whole_;           // [T of mesh_] triangle of the part; empty: the same
  std::vector<std::uint8_t> is_new_;           // [T of mesh_] since edges were last split
  std::vector<Cut::Place> settled_;            // [V of the settled mesh] in mesh_
  Mesh finer_mesh_;
  std::vector<SurfacePoint> finer_vertices_;
};

}  // namespace

std::vector<Mesh> best_measured(std::span<const kit::Part> parts, const OverlapConfig& config,
                                QualityMemory* memory) {
  OwnershipMap owners(parts, config, memory);
  std::vector<PartOwnership> own;
  std::vector<std::size_t> counts;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    own.emplace_back(owners, i, config);
    counts.push_back(owners.vertices(i).size());
  }
  for_each_block(counts, [&](std::size_t i, std::size_t begin, std::size_t end) {
    own[i].find_margins(begin, end);
  });
  for_each_index(parts.size(), [&](std::size_t i) { owners.keep(i, own[i].claim()); });
  std::vector<Mesh> out(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {  // one by one: only one of them keeps a place
    Cut also;
    out[i] = own[i].settle(also);
    owners.keep_also(i, std::move(also));
    counts[i] = out[i].positions.size();
  }
  for_each_block(counts, [&](std::size_t i, std::size_t begin, std::size_t end) {
    own[i].level(begin, end, out[i]);
  });
  return out;
}

}  // namespace mr::merge
