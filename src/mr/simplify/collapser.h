#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/simplify/quadric.h"
#include "mr/simplify/stars.h"

namespace mr::simplify {

struct Place {
  Vec3f at;
  float error = 0;  ///< of the vertex's quadric, here
};

/// Removes vertices one by one: each is pulled into the neighbour that costs the least quadric
/// error (half-edge collapses; Garland & Heckbert 1997). In place of a heap there is one sweep in
/// the order of the vertices, near in memory, that takes all cheap collapses at once; what is left
/// waits in buckets of equal cost, two per doubling, and is looked at again when its turn comes.
class Collapser {
 public:
  explicit Collapser(const Mesh& mesh);

  void reduce_to(std::size_t triangles);
  /// Moves each inner vertex to where its quadric is least; borders stay.
  void relax();
  Mesh mesh() const;
  /// The largest root mean square distance of a vertex to the planes that it stands for.
  float error_m() const;

 private:
  enum class Kind : std::uint8_t { inner, border, fixed };
  /// Vertices that wait for their turn, first come, first served.
  struct Bucket {
    std::uint32_t first = kNobody, last = kNobody;
  };
  static constexpr std::uint32_t kNobody = 0xFFFFFFFFu;

  void add_planes(const Mesh& mesh);
  void add_border(std::uint32_t v);

  int rate(std::uint32_t v);
  std::uint64_t cheapest(int candidates) const;
  bool keeps_facing() const;
  bool keeps_shape(std::uint32_t v, std::uint32_t u);
  void collapse();
  int settle(std::uint32_t v, int bucket);

  int cheap_bucket(std::size_t target);
  void wait(std::uint32_t v, int bucket);
  std::uint32_t next(int bucket);

  Stars stars_;
  std::vector<Place> places_;
  std::vector<Quadric> quadrics_;
  std::vector<Kind> kinds_;
  std::vector<std::array<std::uint32_t, 2>> along_;  // [V] neighbours on the border, forwards, back
  std::vector<Bucket> buckets_;
  std::vector<std::uint32_t> behind_;                   // [V] next in the same bucket
  Stars::Plan plan_;                                    // of the collapse looked at
  std::array<std::uint64_t, Stars::kMaxSize> rated_{};  // candidates: cost's bits, then vertex
};

}  // namespace mr::simplify
