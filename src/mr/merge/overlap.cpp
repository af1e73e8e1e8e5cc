#include "mr/merge/overlap.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <optional>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/kit/raster.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"

namespace mr::merge {
namespace {

constexpr int kNormalRounds = 4;       // sensor noise must not decide who owns a spot
constexpr int kMaxRounds = 6;          // halvings: 64 times finer than the decimated mesh
constexpr double kBorderVoxels = 2.5;  // edges on an overlap's border are at most this long
constexpr float kNearest_m = 0.05f, kFarthest_m = 1000.0f;
constexpr float kSameFacing =
    0.5f;  // normals within 60 degrees: the back of a thin board is another surface

/// What the rays found about one triangle.
struct Votes {
  std::uint32_t alone = 0, won = 0, lost = 0;

  std::uint32_t total() const { return alone + won + lost; }
  double lost_share() const { return total() == 0 ? 0 : static_cast<double>(lost) / total(); }
};

/// One part while its triangles are voted on and cut.
struct Candidate {
  Mesh mesh;
  std::vector<ViewId> views;       // [T]
  std::vector<Vec3f> normals;      // [T] unit, smoothed over the neighbours
  std::vector<float> sigma_m;      // [T] precision of the sensor that measured it
  std::vector<float> score_m;      // [T] sigma / cos(angle): the smaller, the better measured
  std::vector<Votes> votes;        // [T]
  std::vector<std::uint8_t> open;  // [T] still to be voted on
};

/// A ray's meeting with one part.
struct Meeting {
  std::uint32_t part = 0, triangle = 0;
};

/// The source that measured a triangle: the only one, or the one whose view textures it.
const SourceInfo* measured_by(const Part& part, ViewId view) {
  if (part.sources.size() == 1) return &part.sources.front();
  for (const SourceInfo& s : part.sources)
    if (s.sensor == view) return &s;
  return nullptr;
}

/// Precision and score of a spot with normal `n`, as measured by `source`.
std::pair<float, float> measure(const SourceInfo& source, Vec3f spot, Vec3f n) {
  const Vec3d ray = vec_cast<double>(spot) - source.T_world_depth.translation;
  const double depth = std::max(dot(ray, source.T_world_depth.rotation.column(2)), 0.0);
  const double cosine = std::max(-dot(normalized(ray), vec_cast<double>(n)), 0.1);
  const double sigma = source.precision.sigma_m(depth);
  return {static_cast<float>(sigma), static_cast<float>(sigma / cosine)};
}

/// Computes what ownership is decided by.
void describe(Candidate& c, const Part& part) {
  const std::size_t count = c.mesh.triangles.size();
  const std::vector<Vec3f> smooth = kit::smooth_normals(c.mesh, kNormalRounds);
  c.normals.resize(count), c.sigma_m.resize(count), c.score_m.resize(count);
  parallel_for(count, 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const Triangle& tri = c.mesh.triangles[t];
      c.normals[t] = normalized(smooth[tri[0]] + smooth[tri[1]] + smooth[tri[2]]);
      c.sigma_m[t] = c.score_m[t] = 0;
      const SourceInfo* source = measured_by(part, c.views[t]);
      for (const SourceInfo& s : part.sources) {  // not known by whom: as bad as the worst could be
        if (source && source != &s) continue;
        const auto [sigma, score] = measure(s, c.mesh.centroid(t), c.normals[t]);
        c.sigma_m[t] = std::max(c.sigma_m[t], sigma), c.score_m[t] = std::max(c.score_m[t], score);
      }
    }
  });
}

/// All parts with the rays that can be cast at them.
class Field {
 public:
  Field(std::span<const Part> parts, std::span<const Candidate> candidates,
        const OverlapConfig& config)
      : parts_(parts), candidates_(candidates), config_(config), rays_(build(candidates)) {}

  /// Casts a ray and calls visit(meetings) for every surface on it: the parts that saw it, the
  /// owner first.
  template <typename Visit>
  void cast(Vec3d origin, Vec3d direction, Visit&& visit) const {
    thread_local std::vector<kit::RayHit> hits;
    const Vec3f o = vec_cast<float>(origin), d = vec_cast<float>(direction);
    rays_.all_hits(o, d, kNearest_m, kFarthest_m, hits);
    std::erase_if(hits, [&](const kit::RayHit& h) {
      return dot(candidates_[h.mesh].mesh.area_normal(h.triangle), d) >= 0;  // seen from behind
    });
    std::vector<Meeting> surface;
    for (std::size_t i = 0; i < hits.size(); ++i) {
      if (hits[i].mesh == kTaken) continue;
      surface.assign(1, {hits[i].mesh, hits[i].triangle});
      for (std::size_t k = i + 1; k < hits.size(); ++k) {
        if (hits[k].mesh == kTaken || !same_surface(hits[i], hits[k], d)) continue;
        const bool seen = std::any_of(surface.begin(), surface.end(),
                                      [&](const Meeting& m) { return m.part == hits[k].mesh; });
        if (seen) continue;
        surface.push_back({hits[k].mesh, hits[k].triangle});
        hits[k].mesh = kTaken;
      }
      owner_first(surface);
      visit(std::span<const Meeting>(surface));
    }
  }

 private:
  static constexpr std::uint32_t kTaken = 0xFFFFFFFFu;

  static kit::RayScene build(std::span<const Candidate> candidates) {
    std::vector<const Mesh*> meshes;
    for (const Candidate& c : candidates) meshes.push_back(&c.mesh);
    return kit::RayScene(meshes);
  }

  /// Whether a farther hit of another part is the same surface as a nearer one.
  bool same_surface(const kit::RayHit& near, const kit::RayHit& far, Vec3f direction) const {
    if (near.mesh == far.mesh) return false;
    const Candidate &a = candidates_[near.mesh], &b = candidates_[far.mesh];
    const Vec3f n = a.normals[near.triangle];
    if (dot(n, b.normals[far.triangle]) < kSameFacing) return false;
    const auto decimation = [&](const Part& p) {
      return std::min(p.error_m, static_cast<float>(config_.voxel_m));
    };
    const float range = 2 * std::max(a.sigma_m[near.triangle], b.sigma_m[far.triangle]) +
                        2 * static_cast<float>(config_.calibration_error_m) +
                        decimation(parts_[near.mesh]) + decimation(parts_[far.mesh]);
    const float along_ray = (far.distance - near.distance) * length(direction);
    const float apart = (far.distance - near.distance) * std::abs(dot(n, direction));
    return apart <= range && along_ray <= 4 * range;
  }

  /// Sorted by distance already, which is the paper's order.
  void owner_first(std::vector<Meeting>& surface) const {
    if (config_.owner == MergeConfig::Owner::paper) return;
    const auto key = [&](const Meeting& m) {
      return std::pair(candidates_[m.part].score_m[m.triangle], m.part);
    };
    std::iter_swap(surface.begin(), std::min_element(surface.begin(), surface.end(),
                                                     [&](const Meeting& a, const Meeting& b) {
                                                       return key(a) < key(b);
                                                     }));
  }

  std::span<const Part> parts_;
  std::span<const Candidate> candidates_;
  const OverlapConfig& config_;
  kit::RayScene rays_;
};

std::vector<const SourceInfo*> all_sources(std::span<const Part> parts) {
  std::vector<const SourceInfo*> out;
  for (const Part& p : parts)
    for (const SourceInfo& s : p.sources) out.push_back(&s);
  return out;
}

/// Casts through a camera's pixels, all or those that `mask` marks: as dense as it takes to meet a
/// surface 3 m away once a voxel, so through every second pixel or with several rays in one.
template <typename Visit>
void cast_from_camera(const Field& field, const SourceInfo& source, const ImageMask* mask,
                      double voxel_m, const Visit& visit) {
  const Camera& camera = source.depth_camera;
  const double pixel_voxels = 3 / (camera.fx * voxel_m);
  const int stride = !mask && pixel_voxels < 0.6 ? 2 : 1;
  const int fine = std::clamp(static_cast<int>(std::ceil(pixel_voxels - 0.1)), 1, 4);
  const int rows = (camera.height + stride - 1) / stride;
  parallel_for(rows, 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row)
      for (int x = 0; x < camera.width; x += stride) {
        const int y = static_cast<int>(row) * stride;
        if (mask && !*mask->at(x, y)) continue;
        for (int i = 0; i < fine * fine; ++i) {
          const Vec2d at{x + (i % fine + 0.5) / fine - 0.5, y + (i / fine + 0.5) / fine - 0.5};
          field.cast(source.T_world_depth.translation,
                     source.T_world_depth.rotation * unproject(camera, at), visit);
        }
      }
  });
}

/// The pixels of a camera behind which a triangle of any part is flagged.
ImageMask pixels_of(const SourceInfo& source, std::span<const Candidate> candidates,
                    const std::function<bool(const Candidate&, std::size_t)>& flagged) {
  const Camera& camera = source.depth_camera;
  ImageMask mask(camera.width, camera.height);
  const Pose T_camera_world = source.T_world_depth.inverse();
  for (const Candidate& c : candidates)
    for (std::size_t t = 0; t < c.mesh.triangles.size(); ++t) {
      if (!flagged(c, t)) continue;
      const auto corner = [&](int i) {
        return T_camera_world * vec_cast<double>(c.mesh.corner(t, i));
      };
      const auto polygon = kit::clip_to_screen(camera, {corner(0), corner(1), corner(2)});
      kit::scan_polygon(polygon, camera.width, 0, camera.height,
                        [&](int x, int y, double) { *mask.at(x, y) = 1; });
    }
  return mask;
}

void add(std::uint32_t& counter) {
  std::atomic_ref(counter).fetch_add(1, std::memory_order_relaxed);
}

/// Notes the outcome of one surface for the triangles that are still open.
void vote(std::vector<Candidate>& candidates, std::span<const Meeting> surface) {
  for (std::size_t i = 0; i < surface.size(); ++i) {
    Candidate& c = candidates[surface[i].part];
    if (!c.open[surface[i].triangle]) continue;
    Votes& v = c.votes[surface[i].triangle];
    add(surface.size() == 1 ? v.alone : i == 0 ? v.won : v.lost);
  }
}

/// Triangles that fall between the pixels get one ray through their middle, from the first camera
/// that they face.
void vote_on_missed(std::vector<Candidate>& candidates, const Field& field,
                    std::span<const SourceInfo* const> sources) {
  for (std::uint32_t part = 0; part < candidates.size(); ++part) {
    Candidate& c = candidates[part];
    parallel_for(c.mesh.triangles.size(), 512, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        if (!c.open[t] || c.votes[t].total() > 0) continue;
        const Vec3d middle = vec_cast<double>(c.mesh.centroid(t));
        for (const SourceInfo* s : sources) {
          const Vec3d ray = middle - s->T_world_depth.translation;
          if (dot(ray, vec_cast<double>(c.mesh.area_normal(t))) >= 0) continue;
          const auto pixel = project(s->depth_camera, s->T_world_depth.inverse() * middle);
          if (!pixel || pixel->x < 0 || pixel->y < 0 || pixel->x > s->depth_camera.width - 1 ||
              pixel->y > s->depth_camera.height - 1)
            continue;
          Votes found;
          field.cast(s->T_world_depth.translation, ray, [&](std::span<const Meeting> surface) {
            for (std::size_t i = 0; i < surface.size(); ++i)
              if (surface[i].part == part && surface[i].triangle == t)
                ++(surface.size() == 1 ? found.alone : i == 0 ? found.won : found.lost);
          });
          c.votes[t] = found;
          if (found.total() > 0) break;
        }
      }
    });
  }
}

/// Cuts the long edges of triangles that lie in an overlap only partly. Their pieces are open for
/// votes; pieces of neighbours keep their verdict. All pieces keep the score of the whole, so that
/// no verdict that was given turns round. Returns whether anything was cut.
bool cut_mixed(Candidate& c, double max_edge_m) {
  std::vector<std::uint8_t> split(c.mesh.triangles.size() * 3, 0),
      mixed(c.mesh.triangles.size(), 0);
  bool any = false;
  for (std::uint32_t h = 0; h < split.size(); ++h) {
    const double share = c.votes[h / 3].lost_share();
    if (share == 0 || share == 1) continue;
    const Vec3f edge =
        c.mesh.positions[kit::edge_to(c.mesh, h)] - c.mesh.positions[kit::edge_from(c.mesh, h)];
    if (length(edge) <= max_edge_m) continue;
    split[h] = mixed[h / 3] = 1;
    any = true;
  }
  std::fill(c.open.begin(), c.open.end(), 0);
  if (!any) return false;
  kit::Refined fine = kit::refine(c.mesh, split);
  Candidate cut;
  for (const std::uint32_t parent : fine.parent) {
    cut.views.push_back(c.views[parent]);
    cut.votes.push_back(mixed[parent] ? Votes{} : c.votes[parent]);
    cut.open.push_back(mixed[parent]);
    cut.normals.push_back(c.normals[parent]);
    cut.sigma_m.push_back(c.sigma_m[parent]);
    cut.score_m.push_back(c.score_m[parent]);
  }
  cut.mesh = std::move(fine.mesh);
  c = std::move(cut);
  return true;
}

std::vector<Candidate> candidates_of(std::span<const Part> parts) {
  std::vector<Candidate> out(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    MR_ASSERT(!parts[i].sources.empty());
    Candidate& c = out[i];
    c.views = triangle_views(parts[i].mesh);
    c.mesh = parts[i].mesh;
    c.mesh.runs.clear();
    c.votes.resize(c.views.size());
    c.open.assign(c.views.size(), 1);
    describe(c, parts[i]);
  }
  return out;
}

/// Votes with rays and cuts at the borders of overlaps, until those are fine enough.
void vote_and_cut(std::vector<Candidate>& candidates, std::span<const Part> parts,
                  const OverlapConfig& config) {
  const std::vector<const SourceInfo*> sources = all_sources(parts);
  for (int round = 0; round < kMaxRounds; ++round) {
    const Field field(parts, candidates, config);
    for (const SourceInfo* source : sources) {
      std::optional<ImageMask> mask;
      if (round > 0)
        mask = pixels_of(*source, candidates,
                         [](const Candidate& c, std::size_t t) { return c.open[t] != 0; });
      cast_from_camera(field, *source, mask ? &*mask : nullptr, config.voxel_m,
                       [&](std::span<const Meeting> surface) { vote(candidates, surface); });
    }
    vote_on_missed(candidates, field, sources);
    bool cut = false;
    for (std::size_t i = 0; i < parts.size() && round + 1 < kMaxRounds; ++i)
      cut |= cut_mixed(candidates[i], kBorderVoxels * config.voxel_m);
    if (!cut) return;
  }
}

enum class Verdict : std::uint8_t { keep, remove, island };
using Verdicts = std::vector<std::vector<Verdict>>;  // [part][triangle]

Verdicts verdicts_of(std::span<const Candidate> candidates, MergeConfig::Owner owner) {
  // Coherent owners agree from ray to ray, so a triangle that loses at all lies across a border:
  // rather a narrow gap there than two layers. Nearest owners change from pixel to pixel: majority.
  const double tolerated = owner == MergeConfig::Owner::paper ? 0.5 : 0.05;
  Verdicts out;
  for (const Candidate& c : candidates) {
    out.emplace_back();
    for (const Votes& v : c.votes)
      out.back().push_back(v.lost_share() <= tolerated ? Verdict::keep : Verdict::remove);
  }
  return out;
}

Mesh kept_mesh(const Mesh& mesh, const std::vector<Verdict>& verdicts) {
  std::vector<std::uint8_t> keep;
  for (const Verdict v : verdicts) keep.push_back(v == Verdict::keep);
  return select_triangles(mesh, keep);
}

/// What would float as an island must not be the reason for which another part lost the spot.
void give_up_islands(Verdicts& verdicts, std::span<const Candidate> candidates,
                     double min_area_m2) {
  for (std::size_t p = 0; p < candidates.size(); ++p) {
    const kit::Components pieces = kit::components(kept_mesh(candidates[p].mesh, verdicts[p]));
    std::size_t kept = 0;
    for (Verdict& v : verdicts[p])
      if (v == Verdict::keep && pieces.area_m2[pieces.of_triangle[kept++]] < min_area_m2)
        v = Verdict::island;
  }
}

/// Brings back triangles where removal would leave nothing of a surface: those that lie in a hole
/// as a whole. Narrower gaps are for the zipper, which closes them without a second layer.
void restore_holes(Verdicts& verdicts, std::span<const Candidate> candidates,
                   std::span<const Part> parts, const OverlapConfig& config) {
  std::vector<std::vector<std::uint32_t>> needed(candidates.size()), met(candidates.size());
  for (std::size_t p = 0; p < candidates.size(); ++p) {
    needed[p].assign(verdicts[p].size(), 0);
    met[p].assign(verdicts[p].size(), 0);
  }
  const Field field(parts, candidates, config);
  const auto is = [&](const Meeting& m, Verdict v) { return verdicts[m.part][m.triangle] == v; };
  const auto note = [&](std::span<const Meeting> surface) {
    const Meeting* first_removed = nullptr;
    bool hole = true;
    for (const Meeting& m : surface) {
      if (!is(m, Verdict::remove)) {
        hole &= !is(m, Verdict::keep);
        continue;
      }
      add(met[m.part][m.triangle]);
      if (!first_removed) first_removed = &m;
    }
    if (hole && first_removed) add(needed[first_removed->part][first_removed->triangle]);
  };
  for (const SourceInfo* source : all_sources(parts)) {
    const ImageMask mask = pixels_of(*source, candidates, [&](const Candidate& c, std::size_t t) {
      return verdicts[&c - candidates.data()][t] == Verdict::remove;
    });
    cast_from_camera(field, *source, &mask, config.voxel_m, note);
  }
  for (std::size_t p = 0; p < verdicts.size(); ++p)
    for (std::size_t t = 0; t < verdicts[p].size(); ++t)
      if (met[p][t] > 0 && needed[p][t] * 20 >= met[p][t] * 19) verdicts[p][t] = Verdict::keep;
}

}  // namespace

std::vector<Mesh> remove_overlap(std::span<const Part> parts, const OverlapConfig& config) {
  std::vector<Candidate> candidates = candidates_of(parts);
  if (parts.size() > 1) vote_and_cut(candidates, parts, config);
  Verdicts verdicts = verdicts_of(candidates, config.owner);
  if (parts.size() > 1) {
    give_up_islands(verdicts, candidates, config.island_area_m2);
    restore_holes(verdicts, candidates, parts, config);
  }
  std::vector<Mesh> out;
  for (std::size_t i = 0; i < candidates.size(); ++i)
    out.push_back(kept_mesh(candidates[i].mesh, verdicts[i]));
  return out;
}

}  // namespace mr::merge
