#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::simplify {

/// The edge opposite a vertex in one of its triangles: (vertex, a, b) is counter-clockwise.
struct Opposite {
  std::uint32_t a = 0, b = 0;
};

/// A mesh as the star of every vertex: the opposite edges of its triangles, in no order. One star
/// fills one cache line while the vertex has up to eight triangles, and a collapse only rewrites
/// the stars around it: nothing is ever rebuilt.
class Stars {
 public:
  /// Triangles that name a vertex twice are left out.
  explicit Stars(const Mesh& mesh);

  std::size_t triangle_count() const { return triangles_; }
  std::span<const Opposite> of(std::uint32_t v) const {
    return {pool_.data() + stars_[v].first, stars_[v].size};
  }

  static constexpr std::size_t kMaxSize = 48;  ///< a vertex with more triangles stays

  /// What the collapse of v into u would do to v's triangles: those with u (`shared`) vanish.
  struct Plan {
    std::uint32_t v = 0, u = 0;
    unsigned shared = 0, kept = 0;
    std::array<std::uint32_t, kMaxSize + 1> apex;  ///< [shared] third corners
    std::array<Opposite, kMaxSize + 1> stays;      ///< [kept]
  };
  /// v's star must not be larger than kMaxSize.
  void plan(std::uint32_t v, std::uint32_t u, Plan& plan) const;

  /// The link condition (Dey et al. 1999): after the collapse no edge has more triangles than
  /// before, no triangle appears twice, and no part of the mesh vanishes.
  bool stays_manifold(const Plan& plan);

  /// Moves v's triangles to u; `end` is v's neighbour that only the last triangle of an open fan
  /// names, u if there is none. v's star is empty afterwards.
  void collapse(const Plan& plan, std::uint32_t end);

 private:
  struct Star {
    std::uint32_t first = 0, size = 0;
    std::uint32_t capacity = kLine;  // a multiple of kLine
    std::uint32_t mark = 0;          // see stays_manifold
  };
  static constexpr std::uint32_t kLine = 8;

  void add(std::uint32_t v, Opposite opposite);
  void grow(Star& star, std::uint32_t capacity);
  void rename(std::uint32_t in, std::uint32_t v, std::uint32_t u);
  void drop_collapsed(std::uint32_t in);

  std::vector<Opposite> pool_;
  std::vector<Star> stars_;
  std::size_t triangles_ = 0;
  std::uint32_t round_ = 0;  // of marks
};

}  // namespace mr::simplify
