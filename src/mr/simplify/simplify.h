#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/core/result.h"

namespace mr::simplify {

/// Where decimation stops, at the first limit that it meets, and what it respects.
struct SimplifyOptions {
  /// Goes on until so many triangles are left, within 1 %.
  std::size_t triangles = 0;
  /// No collapse errs more: the RMS distance of the vertex that stays to all planes it stands for.
  float error_m = std::numeric_limits<float>::infinity();
  /// Stops in time, with the least error that so many triangles can have. Not deterministic.
  std::optional<std::chrono::nanoseconds> time{};

  /// [V], or empty: all 1. How often errors count (hands and faces against walls): what is 4 may
  /// err half of error_m, and keeps more of a count of triangles. Over 0, at most a million.
  std::span<const float> weights{};
  /// [T], or empty: all alike. Triangles of one number stay together, such as those of a chunk.
  /// Lines where two numbers meet are simplified before all else, each on its own, so that they
  /// are the same whatever becomes of the triangles beside them (DESIGN section 4, The border).
  std::span<const std::uint32_t> chunks{};
  /// How far a line between chunks may move. Lines use up triangles: where they leave too few for
  /// a count, more stay.
  float border_error_m = 0.0025f;
};

struct Simplified {
  Mesh mesh;                          ///< runs as in the input
  std::vector<std::uint32_t> chunks;  ///< [T], where the input had them
  float error_m = 0;  ///< largest RMS distance of a vertex to the planes that it stands for
};

/// Decimates meshes by quadric error (Garland & Heckbert 1997; paper 3.1): vertices are pulled into
/// neighbours, those that stay are moved to where their error is least. Real borders only lose
/// vertices, within the error; runs keep together. Nothing is flipped, no edge gets more triangles
/// than it had, no hole closes and no separate part vanishes, so a mesh of many small parts may
/// keep more triangles than wanted. Parallel; the same bytes on any number of threads. Keeps its
/// memory from call to call. A target that the input meets already returns it as it is, also where
/// it is degenerate. invalid: a position is not finite or over 1000 km away, an index has no
/// vertex, or options do not fit.
class Simplifier {
 public:
  Simplifier();
  ~Simplifier();
  Simplifier(Simplifier&&) noexcept;
  Simplifier& operator=(Simplifier&&) noexcept;

  Result<Simplified> run(const Mesh& mesh, const SimplifyOptions& options);
  /// Several levels of detail from one pass: one per entry of `triangles`, which falls and takes
  /// the place of options.triangles. Lines between chunks are the same in all.
  Result<std::vector<Simplified>> run(const Mesh& mesh, std::span<const std::size_t> triangles,
                                      const SimplifyOptions& options);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// For those who need it once.
Result<Simplified> simplify(const Mesh& mesh, const SimplifyOptions& options);

/// A share of a mesh's triangles, rounded up. `ratio`: (0, 1].
std::size_t triangles_at(const Mesh& mesh, double ratio);

}  // namespace mr::simplify
