#include "mr/merge/overlap.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/merge/layers.h"
#include "mr/merge/ray_grids.h"

namespace mr::merge {
namespace {

constexpr int kNormalRounds = 4;       // sensor noise must not decide who owns a spot
constexpr int kMaxCuts = 5;            // halvings: 32 times finer than the decimated mesh
constexpr double kBorderVoxels = 2.5;  // edges on an overlap's border are at most this long
constexpr float kSameFacing =
    0.5f;  // normals within 60 degrees: the back of a thin board is another surface

/// What the rays found about one triangle.
struct Votes {
  std::uint32_t alone = 0, won = 0, lost = 0;

  std::uint32_t total() const { return alone + won + lost; }
  double lost_share() const { return total() == 0 ? 0 : static_cast<double>(lost) / total(); }
};

/// What ownership of a triangle is decided by. Its pieces inherit it, so that no verdict that was
/// given turns round.
struct Spot {
  std::uint32_t part = 0;
  Vec3f normal;       // unit, smoothed over the neighbours
  float sigma_m = 0;  // precision of the sensor that measured it
  float score_m = 0;  // sigma / cos(angle): the smaller, the better measured
  float slack_m = 0;  // error of calibration and decimation
};

/// All parts side by side in one mesh while its triangles are voted on and cut. Each part is a
/// range of triangles.
struct Field {
  Mesh mesh;
  std::vector<Spot> spots;           // of the triangles as they came
  std::vector<std::uint32_t> whole;  // [T] place in `spots`
  std::vector<Votes> votes;          // [T]
  std::vector<std::uint8_t> open;    // [T] still to be voted on

  const Spot& spot(std::uint32_t triangle) const { return spots[whole[triangle]]; }
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
  const double depth = source.depth_camera.model == CameraModel::pinhole
                           ? std::max(dot(ray, source.T_world_depth.rotation.column(2)), 0.0)
                           : length(ray);
  const double cosine = std::max(-dot(normalized(ray), vec_cast<double>(n)), 0.1);
  const double sigma = source.precision.sigma_m(depth);
  return {static_cast<float>(sigma), static_cast<float>(sigma / cosine)};
}

/// Computes what ownership of a part's triangles is decided by.
void describe(const Part& part, std::uint32_t number, const OverlapConfig& config, Spot* spots) {
  const std::vector<ViewId> views = triangle_views(part.mesh);
  const std::vector<Vec3f> smooth = kit::smooth_normals(part.mesh, kNormalRounds);
  const float slack = static_cast<float>(config.calibration_error_m) +
                      std::min(part.error_m, static_cast<float>(config.voxel_m));
  for (std::size_t t = 0; t < views.size(); ++t) {
    const Triangle& tri = part.mesh.triangles[t];
    Spot& spot = spots[t];
    spot.part = number, spot.slack_m = slack;
    spot.normal = normalized(smooth[tri[0]] + smooth[tri[1]] + smooth[tri[2]]);
    const SourceInfo* source = measured_by(part, views[t]);
    for (const SourceInfo& s : part.sources) {  // not known by whom: as bad as the worst could be
      if (source && source != &s) continue;
      const auto [sigma, score] = measure(s, part.mesh.centroid(t), spot.normal);
      spot.sigma_m = std::max(spot.sigma_m, sigma), spot.score_m = std::max(spot.score_m, score);
    }
  }
}

Field field_of(std::span<const Part> parts, const OverlapConfig& config) {
  Field out;
  std::vector<std::size_t> first;
  for (const Part& part : parts) {
    MR_ASSERT(!part.sources.empty());
    first.push_back(out.mesh.triangles.size());
    append(out.mesh, {part.mesh.positions, part.mesh.triangles, {}});
  }
  const std::size_t count = out.mesh.triangles.size();
  out.spots.resize(count), out.whole.resize(count), out.votes.resize(count);
  out.open.assign(count, 1);
  std::iota(out.whole.begin(), out.whole.end(), 0u);
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      describe(parts[i], static_cast<std::uint32_t>(i), config, out.spots.data() + first[i]);
  });
  return out;
}

/// Whether a farther fragment, of another part, is the same surface as a nearer one.
bool same_surface(const Field& field, const Fragment& near, const Fragment& far, Vec3f ray) {
  const Spot &a = field.spot(near.triangle), &b = field.spot(far.triangle);
  if (a.part == b.part || dot(a.normal, b.normal) < kSameFacing) return false;
  const float range = 2 * std::max(a.sigma_m, b.sigma_m) + a.slack_m + b.slack_m;
  const float deeper = far.depth_m - near.depth_m;
  return deeper * std::abs(dot(a.normal, ray)) <= range && deeper * length(ray) <= 4 * range;
}

/// Brings the fragments of one ray, nearest first, into the order of the surfaces that they are
/// of, each with its owner first.
void join_surfaces(std::span<Fragment> f, Vec3f ray, const Field& field, MergeConfig::Owner owner) {
  const auto score = [&](const Fragment& a) {
    return std::pair(field.spot(a.triangle).score_m, field.spot(a.triangle).part);
  };
  for (std::size_t begin = 0, end; begin < f.size(); begin = end) {
    const auto surface = f.begin() + static_cast<std::ptrdiff_t>(begin);
    end = begin + 1;
    for (std::size_t k = end; k < f.size(); ++k) {
      if (!same_surface(field, f[begin], f[k], ray)) continue;
      const bool seen = std::any_of(surface, surface + (end - begin), [&](const Fragment& m) {
        return field.spot(m.triangle).part == field.spot(f[k].triangle).part;
      });
      if (seen) continue;
      std::rotate(f.begin() + end, f.begin() + k, f.begin() + k + 1);
      f[end++].joined = true;
    }
    if (owner == MergeConfig::Owner::paper) continue;  // the nearest
    const auto best =
        std::min_element(surface, surface + (end - begin),
                         [&](const Fragment& a, const Fragment& b) { return score(a) < score(b); });
    std::iter_swap(surface, best);
    std::swap(surface->joined, best->joined);
  }
}

RayGrids grids_of(std::span<const Part> parts, double voxel_m) {
  RayGrids out;
  for (const Part& part : parts)
    for (const SourceInfo& s : part.sources) add_ray_grids(s, voxel_m, out);
  return out;
}

/// Calls work(i) for every i below `count`, in parallel.
template <typename Work>
void for_each_index(std::size_t count, Work&& work) {
  parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) work(i);
  });
}

/// Draws all parts into the cameras and finds the surfaces on every ray. With `flagged` ([T]):
/// only rays that meet such a triangle.
std::vector<Layers> meet(const Field& field, std::span<const RayGrid> grids,
                         MergeConfig::Owner owner, const std::vector<std::uint8_t>* flagged) {
  std::vector<Layers> out(grids.size());
  for_each_index(grids.size(), [&](std::size_t i) {
    const auto& [camera, T_world_camera] = grids[i];
    out[i] = draw_layers(field.mesh, camera, T_world_camera, flagged);
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x)
        if (const auto on_ray = out[i].at(x, y); on_ray.size() > 1)
          join_surfaces(on_ray, out[i].ray(x, y), field, owner);
  });
  return out;
}

/// Notes what became of fragment `i` of a picture for its triangle, if that is still open.
void vote(Field& field, const Layers& image, std::size_t i) {
  const Fragment& f = image.fragments[i];
  if (!field.open[f.triangle]) return;
  const bool owns = i + 1 < image.fragments.size() && image.fragments[i + 1].joined;
  Votes& votes = field.votes[f.triangle];
  ++(f.joined ? votes.lost : owns ? votes.won : votes.alone);
}

void vote(Field& field, std::span<const Layers> images) {
  for (const Layers& image : images)
    for (std::size_t i = 0; i < image.fragments.size(); ++i) vote(field, image, i);
}

/// What the ray nearest to a triangle's middle would say, were the triangle as large as to meet it
/// in place of what its part has there.
Votes vote_nearby(const Field& field, std::uint32_t triangle, const RayGrid& grid,
                  const Layers& image, MergeConfig::Owner owner) {
  const Vec3d middle = vec_cast<double>(field.mesh.centroid(triangle));
  const auto place = project(grid.camera, grid.T_world_camera.inverse() * middle);
  if (!place) return {};
  const double u = std::round(place->x), v = std::round(place->y);
  if (!(u >= 0 && v >= 0 && u < image.width && v < image.height)) return {};
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const Vec3f ray = image.ray(x, y), normal = field.mesh.area_normal(triangle);
  const float depth = dot(normal, field.mesh.centroid(triangle) - image.origin) / dot(normal, ray);
  if (!(dot(normal, ray) < 0 && depth > 0)) return {};

  std::vector<Fragment> on_ray{{triangle, depth, false}};
  for (const Fragment& f : image.at(x, y))
    if (field.spot(f.triangle).part != field.spot(triangle).part)
      on_ray.push_back({f.triangle, f.depth_m, false});
  std::stable_sort(on_ray.begin(), on_ray.end(),
                   [](const Fragment& a, const Fragment& b) { return a.depth_m < b.depth_m; });
  join_surfaces(on_ray, ray, field, owner);
  std::size_t k = 0;
  while (on_ray[k].triangle != triangle) ++k;
  const bool alone = !on_ray[k].joined && (k + 1 == on_ray.size() || !on_ray[k + 1].joined);
  return {alone, !alone && !on_ray[k].joined, on_ray[k].joined};
}

/// Triangles that fall between the rays follow the nearest of the first camera that they face.
void vote_on_missed(Field& field, std::span<const RayGrid> grids, std::span<const Layers> images,
                    MergeConfig::Owner owner) {
  parallel_for(field.votes.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t)
      for (std::size_t i = 0; i < grids.size() && field.open[t] && field.votes[t].total() == 0; ++i)
        field.votes[t] =
            vote_nearby(field, static_cast<std::uint32_t>(t), grids[i], images[i], owner);
  });
}

/// Leaves open the triangles that lie in an overlap only partly and have long edges; returns those
/// edges ([3T]).
std::vector<std::uint8_t> open_mixed(Field& field, double max_edge_m, bool& any) {
  const Mesh& mesh = field.mesh;
  std::vector<std::uint8_t> split(mesh.triangles.size() * 3, 0);
  std::fill(field.open.begin(), field.open.end(), 0);
  any = false;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const double share = field.votes[t].lost_share();
    if (share == 0 || share == 1) continue;
    for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h)
      split[h] = length(mesh.positions[kit::edge_to(mesh, h)] -
                        mesh.positions[kit::edge_from(mesh, h)]) > max_edge_m;
    field.open[t] = split[3 * t] || split[3 * t + 1] || split[3 * t + 2];
    any |= field.open[t] != 0;
  }
  return split;
}

/// The piece, out of triangles [begin, end) in one plane, that a point of the plane lies in, seen
/// along an axis that the plane faces (sign 1) or faces away from (-1).
template <int kAxis>
std::uint32_t piece_along(const Mesh& mesh, std::uint32_t begin, std::uint32_t end, Vec3f p,
                          float sign) {
  const auto from_p = [&](std::uint32_t t, int i) {
    const Vec3f d = mesh.corner(t, i) - p;
    return Vec2f{d[(kAxis + 1) % 3], d[(kAxis + 2) % 3]};
  };
  const auto area = [](Vec2f a, Vec2f b) { return a.x * b.y - a.y * b.x; };
  const auto depth_inside = [&](std::uint32_t t) {
    const Vec2f a = from_p(t, 0), b = from_p(t, 1), c = from_p(t, 2);
    return std::min({sign * area(a, b), sign * area(b, c), sign * area(c, a)});
  };
  std::uint32_t best = begin;
  float deepest = depth_inside(begin);
  for (std::uint32_t t = begin + 1; t < end && deepest < 0; ++t)
    if (const float depth = depth_inside(t); depth > deepest) deepest = depth, best = t;
  return best;
}

/// The same along the axis that the plane faces most.
std::uint32_t piece_at(const Mesh& mesh, std::uint32_t begin, std::uint32_t end, Vec3f p) {
  const Vec3f n = mesh.area_normal(begin);
  const Vec3f size{std::abs(n.x), std::abs(n.y), std::abs(n.z)};
  if (size.x >= size.y && size.x >= size.z)
    return piece_along<0>(mesh, begin, end, p, n.x < 0 ? -1.0f : 1.0f);
  if (size.y >= size.z) return piece_along<1>(mesh, begin, end, p, n.y < 0 ? -1.0f : 1.0f);
  return piece_along<2>(mesh, begin, end, p, n.z < 0 ? -1.0f : 1.0f);
}

/// Moves the fragments of triangles that were cut to their pieces: those of triangle t are
/// [first[t], first[t + 1]) in `mesh`. Returns the fragments that changed.
std::vector<std::uint32_t> move_to_pieces(Layers& image, const Mesh& mesh,
                                          std::span<const std::uint32_t> first) {
  std::vector<std::uint32_t> moved;
  int pixel = 0;
  for (std::uint32_t i = 0; i < image.fragments.size(); ++i) {
    Fragment& f = image.fragments[i];
    const std::uint32_t begin = first[f.triangle], end = first[f.triangle + 1];
    f.triangle = begin;
    if (end - begin == 1) continue;
    while (image.first[pixel + 1] <= i) ++pixel;
    const Vec3f ray = image.ray(pixel % image.width, pixel / image.width);
    f.triangle = piece_at(mesh, begin, end, image.origin + ray * f.depth_m);
    moved.push_back(i);
  }
  return moved;
}

/// Cuts edges ([3T]). Pieces of open triangles are voted on anew; those of neighbours keep their
/// verdict.
void cut(Field& field, std::span<Layers> images, const std::vector<std::uint8_t>& split) {
  kit::Refined fine = kit::refine(field.mesh, split);
  std::vector<std::uint32_t> first(field.mesh.triangles.size() + 1, 0);
  Field out;
  out.whole.reserve(fine.parent.size());
  out.votes.reserve(fine.parent.size());
  out.open.reserve(fine.parent.size());
  for (const std::uint32_t parent : fine.parent) {
    ++first[parent + 1];
    out.whole.push_back(field.whole[parent]);
    out.votes.push_back(field.open[parent] ? Votes{} : field.votes[parent]);
    out.open.push_back(field.open[parent]);
  }
  std::partial_sum(first.begin(), first.end(), first.begin());
  out.mesh = std::move(fine.mesh);
  out.spots = std::move(field.spots);
  field = std::move(out);
  std::vector<std::vector<std::uint32_t>> moved(images.size());
  for_each_index(images.size(),
                 [&](std::size_t i) { moved[i] = move_to_pieces(images[i], field.mesh, first); });
  for (std::size_t i = 0; i < images.size(); ++i)
    for (const std::uint32_t fragment : moved[i]) vote(field, images[i], fragment);
}

/// Votes with rays and cuts at the borders of overlaps, until those are fine enough. Returns the
/// rays and what they met.
std::vector<Layers> vote_and_cut(Field& field, std::span<const Part> parts,
                                 const OverlapConfig& config) {
  const RayGrids grids = grids_of(parts, config.voxel_m);
  std::vector<Layers> images = meet(field, grids.sparse, config.owner, nullptr);
  vote(field, images);
  vote_on_missed(field, grids.sparse, images, config.owner);

  const double max_edge_m = kBorderVoxels * config.voxel_m;
  bool any = false;
  std::vector<std::uint8_t> split = open_mixed(field, max_edge_m, any);
  if (any) {
    std::vector<Layers> more = meet(field, grids.dense, config.owner, &field.open);
    vote(field, more);
    std::move(more.begin(), more.end(), std::back_inserter(images));
  }
  for (int i = 0; i < kMaxCuts && any; ++i) {
    cut(field, images, split);
    vote_on_missed(field, grids.sparse, images, config.owner);
    split = open_mixed(field, max_edge_m, any);
  }
  return images;
}

enum class Verdict : std::uint8_t { keep, remove, island };
using Verdicts = std::vector<Verdict>;  // [T]

Verdicts verdicts_of(const Field& field, MergeConfig::Owner owner) {
  // Coherent owners agree from ray to ray, so a triangle that loses at all lies across a border:
  // rather a narrow gap there than two layers. Nearest owners change from pixel to pixel: majority.
  const double tolerated = owner == MergeConfig::Owner::paper ? 0.5 : 0.05;
  Verdicts out;
  for (const Votes& v : field.votes)
    out.push_back(v.lost_share() <= tolerated ? Verdict::keep : Verdict::remove);
  return out;
}

/// What is kept of every part.
std::vector<Mesh> kept_meshes(const Field& field, const Verdicts& verdicts, std::size_t parts) {
  std::vector<Mesh> out(parts);
  for_each_index(parts, [&](std::size_t part) {
    std::vector<std::uint8_t> keep(verdicts.size());
    for (std::uint32_t t = 0; t < keep.size(); ++t)
      keep[t] = verdicts[t] == Verdict::keep && field.spot(t).part == part;
    out[part] = select_triangles(field.mesh, keep);
  });
  return out;
}

/// What would float as an island must not be the reason for which another part lost the spot.
void give_up_islands(Verdicts& verdicts, const Field& field, std::size_t parts,
                     double min_area_m2) {
  const std::vector<Mesh> kept = kept_meshes(field, verdicts, parts);
  std::vector<kit::Components> pieces(parts);
  for_each_index(parts, [&](std::size_t i) { pieces[i] = kit::components(kept[i]); });
  std::vector<std::size_t> next(parts, 0);
  for (std::uint32_t t = 0; t < verdicts.size(); ++t) {
    if (verdicts[t] != Verdict::keep) continue;
    const std::uint32_t part = field.spot(t).part;
    if (pieces[part].area_m2[pieces[part].of_triangle[next[part]++]] < min_area_m2)
      verdicts[t] = Verdict::island;
  }
}

/// Brings back triangles where removal would leave nothing of a surface: those that lie in a hole
/// as a whole. Narrower gaps are for the zipper, which closes them without a second layer.
void restore_holes(Verdicts& verdicts, std::span<const Layers> images) {
  std::vector<std::uint32_t> needed(verdicts.size(), 0), met(verdicts.size(), 0);
  for (const Layers& image : images) {
    const std::vector<Fragment>& all = image.fragments;
    for (std::size_t begin = 0, end; begin < all.size(); begin = end) {  // one surface
      const Fragment* first_removed = nullptr;
      bool hole = true;
      for (end = begin; end == begin || (end < all.size() && all[end].joined); ++end) {
        const Verdict verdict = verdicts[all[end].triangle];
        hole &= verdict != Verdict::keep;
        if (verdict != Verdict::remove) continue;
        ++met[all[end].triangle];
        if (!first_removed) first_removed = &all[end];
      }
      if (hole && first_removed) ++needed[first_removed->triangle];
    }
  }
  for (std::size_t t = 0; t < verdicts.size(); ++t)
    if (met[t] > 0 && needed[t] * 20 >= met[t] * 19) verdicts[t] = Verdict::keep;
}

}  // namespace

std::vector<Mesh> remove_overlap(std::span<const Part> parts, const OverlapConfig& config) {
  Field field = field_of(parts, config);
  std::vector<Layers> images;
  if (parts.size() > 1) images = vote_and_cut(field, parts, config);
  Verdicts verdicts = verdicts_of(field, config.owner);
  if (parts.size() > 1) {
    give_up_islands(verdicts, field, parts.size(), config.island_area_m2);
    restore_holes(verdicts, images);
  }
  return kept_meshes(field, verdicts, parts.size());
}

}  // namespace mr::merge
