#include "mr/merge/overlap/raster_voter.h"

#include <algorithm>
#include <functional>
#include <numeric>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/kit/layered_rasterizer.h"

namespace mr::merge {
namespace {

using kit::Fragment;

/// The votes on a triangle in one tile.
struct TriangleVotes {
  TriangleSurface facing;
  std::uint32_t hits = 0, lost = 0;
};

/// The votes of a tile's rays.
struct TileVotes {
  std::vector<TriangleVotes> entries;    ///< as the tile's triangles
  std::vector<RayVerdict> verdicts;      ///< if asked for
  std::vector<std::uint32_t> per_pixel;  ///< how many of them, if asked for
};

/// Votes on the rays of a tile and counts lost ones.
class TileRays {
 public:
  TileRays(const TriangleTable& field, const RayPencil& rays, const kit::RasterTile& tile,
           TileVotes& votes)
      : field_(field), rays_(rays), tile_(tile), votes_(votes) {
    constexpr std::size_t kAhead = 12;
    const std::vector<std::uint32_t>& triangles = tile.triangles;
    votes.entries.resize(triangles.size());
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      if (i + kAhead < triangles.size()) __builtin_prefetch(&field.facing[triangles[i + kAhead]]);
      votes.entries[i] = {field.facing[triangles[i]], tile.covered[i], 0};
    }
    votes.verdicts.clear(), votes.per_pixel.clear();
  }

  /// The same as many() for two fragments, branchless.
  void two(Vec3f ray, Fragment a, Fragment b) {
    put_in_order(a, b);
    entry(b).lost += same(a, b, ray, dot(ray, ray));
  }

  void three(Vec3f ray, Fragment a, Fragment b, Fragment c) {
    put_in_order(a, b), put_in_order(b, c), put_in_order(a, b);
    const float stretch2 = dot(ray, ray);
    const bool a_takes_b = same(a, b, ray, stretch2);
    const bool one_part = entry(b).facing.part == entry(c).facing.part;
    const bool a_takes_c = same(a, c, ray, stretch2) & !(a_takes_b & one_part);
    const bool b_takes_c = same(b, c, ray, stretch2) & !a_takes_b;
    entry(b).lost += a_takes_b;
    entry(c).lost += a_takes_c | b_takes_c;
  }

  void many(Vec3f ray, std::span<const Fragment> fragments) {
    sorted_.clear();
    for (const Fragment& f : fragments) sorted_.push_back(f.key());
    if (fragments.size() <= kFew)
      for (std::size_t i = 1; i < sorted_.size(); ++i)
        for (std::size_t k = i; k > 0 && sorted_[k] > sorted_[k - 1]; --k)
          std::swap(sorted_[k - 1], sorted_[k]);
    else
      std::sort(sorted_.begin(), sorted_.end(), std::greater<>());
    on_ray_.clear();
    for (const std::uint64_t key : sorted_) {
      const Fragment f = Fragment::of_key(key);
      on_ray_.push_back({1 / f.inv_z, tile_.triangles[f.entry()], false});
    }
    decide(on_ray_, field_, ray);
    for (std::size_t i = 0; i < sorted_.size(); ++i)
      entry(Fragment::of_key(sorted_[i])).lost += on_ray_[i].lost;
  }

  /// Records the votes of many().
  void write_verdicts() {
    std::sort(
        on_ray_.begin(), on_ray_.end(),
        [](const RayIntersection& a, const RayIntersection& b) { return a.triangle < b.triangle; });
    for (const RayIntersection& m : on_ray_) votes_.verdicts.push_back({m.triangle, m.lost});
    votes_.per_pixel.push_back(static_cast<std::uint32_t>(on_ray_.size()));
  }

  /// The ray through a pixel of the tile.
  Vec3f ray(int x, int y) const { return rays_.at(x + tile_.left, y + tile_.top); }

 private:
  static constexpr std::size_t kFew = 16;

  static void put_in_order(Fragment& a, Fragment& b) {
    const std::uint64_t one = a.key(), other = b.key();
    const std::uint64_t swap = (one ^ other) & (std::uint64_t{0} - (one < other));  // no branch
    a = Fragment::of_key(one ^ swap), b = Fragment::of_key(other ^ swap);
  }
  TriangleVotes& entry(const Fragment& f) { return votes_.entries[f.entry()]; }
  bool same(const Fragment& a, const Fragment& b, Vec3f ray, float stretch2) {
    return same_surface(entry(a).facing, entry(b).facing, 1 / b.inv_z - 1 / a.inv_z, ray, stretch2);
  }

  const TriangleTable& field_;
  RayPencil rays_;
  const kit::RasterTile& tile_;
  TileVotes& votes_;
  std::vector<std::uint64_t> sorted_;  ///< keys
  std::vector<RayIntersection> on_ray_;
};

}  // namespace

struct RasterVoter::Impl {
  explicit Impl(const TriangleTable& f) : field(f) {}

  const TriangleTable& field;
  kit::LayeredRasterizer rasterizer;
  std::vector<TileVotes> tiles;  ///< [tiles of the rasterizer] and perhaps more

  void decide_tile(const RayGrid& grid, std::size_t number, kit::ABuffer& buffer,
                   bool with_verdicts);
  RayVerdicts verdicts(const Camera& camera) const;
  void count(RayVotes& votes) const;
};

void RasterVoter::Impl::decide_tile(const RayGrid& grid, std::size_t number, kit::ABuffer& buffer,
                                    bool with_verdicts) {
  const kit::RasterTile& tile = rasterizer.tiles()[number];
  TileRays rays(field, RayPencil(grid), tile, tiles[number]);
  if (with_verdicts)
    return buffer.for_each_pixel(tile.columns, tile.rows, 0,
                                 [&](int x, int y, std::span<const Fragment> f) {
                                   rays.many(rays.ray(x, y), f), rays.write_verdicts();
                                 });
  buffer.for_each_pixel(tile.columns, tile.rows, 2, [&](int x, int y, std::span<const Fragment> f) {
    if (f.size() == 2)
      rays.two(rays.ray(x, y), f[0], f[1]);
    else if (f.size() == 3)
      rays.three(rays.ray(x, y), f[0], f[1], f[2]);
    else
      rays.many(rays.ray(x, y), f);
  });
}

/// The verdicts of all tiles, as one picture.
RayVerdicts RasterVoter::Impl::verdicts(const Camera& camera) const {
  RayVerdicts out{camera.width, camera.height, {}, {}};
  out.first.assign(static_cast<std::size_t>(camera.width) * camera.height + 1, 0);
  const std::span<const kit::RasterTile> drawn = rasterizer.tiles();
  const auto for_each_pixel = [&](auto&& work) {
    for (std::size_t t = 0; t < drawn.size(); ++t)
      for (std::size_t i = 0; i < tiles[t].per_pixel.size(); ++i) {
        const int x = drawn[t].left + static_cast<int>(i) % drawn[t].columns;
        const int y = drawn[t].top + static_cast<int>(i) / drawn[t].columns;
        work(tiles[t], i, static_cast<std::size_t>(y) * camera.width + x);
      }
  };
  for_each_pixel([&](const TileVotes& tile, std::size_t i, std::size_t pixel) {
    out.first[pixel + 1] = tile.per_pixel[i];
  });
  std::partial_sum(out.first.begin(), out.first.end(), out.first.begin());
  out.verdicts.resize(out.first.back());
  const RayVerdict* from = nullptr;
  for_each_pixel([&](const TileVotes& tile, std::size_t i, std::size_t pixel) {
    if (i == 0) from = tile.verdicts.data();
    std::copy_n(from, tile.per_pixel[i], out.verdicts.begin() + out.first[pixel]);
    from += tile.per_pixel[i];
  });
  return out;
}

/// Adds up all tiles' votes.
void RasterVoter::Impl::count(RayVotes& votes) const {
  const std::span<const kit::RasterTile> drawn = rasterizer.tiles();
  const auto add = [&](std::size_t t, std::size_t entry) {
    const std::uint32_t triangle = drawn[t].triangles[entry];
    votes.hits[triangle] += tiles[t].entries[entry].hits;
    votes.lost[triangle] += tiles[t].entries[entry].lost;
  };
  parallel_for(rasterizer.block_count(), 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t t = 0; t < drawn.size(); ++t)
        for (std::uint32_t e = drawn[t].first[i]; e < drawn[t].first[i + 1]; ++e) add(t, e);
  });
  for (std::size_t t = 0; t < drawn.size(); ++t)
    for (std::size_t e = drawn[t].first.back(); e < drawn[t].triangles.size(); ++e) add(t, e);
}

RasterVoter::RasterVoter(const TriangleTable& field) : impl_(std::make_unique<Impl>(field)) {}
RasterVoter::~RasterVoter() = default;

void RasterVoter::cast(const RayGrid& grid, std::span<const std::uint32_t> parts, RayVotes& votes,
                       RayVerdicts* verdicts) {
  Impl& m = *impl_;
  std::vector<kit::LayeredMesh> meshes;
  for (const std::uint32_t part : parts)
    meshes.push_back({&m.field.parts[part].mesh, m.field.first[part]});
  m.rasterizer.draw(
      meshes, grid.camera, grid.T_world_camera,
      [&](std::size_t tiles) {
        if (m.tiles.size() < tiles) m.tiles.resize(tiles);
      },
      [&](std::size_t tile, kit::ABuffer& buffer) {
        m.decide_tile(grid, tile, buffer, verdicts != nullptr);
      });
  m.count(votes);
  if (verdicts) *verdicts = m.verdicts(grid.camera);
}

}  // namespace mr::merge
