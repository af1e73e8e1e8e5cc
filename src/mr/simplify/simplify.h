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

/// Stopping criteria of decimation, of which the first one met counts, and constraints.
struct SimplifyOptions {
  /// Target number of triangles, met within 1 %.
  std::size_t triangles = 0;
  /// Largest error of a collapse, metres: the RMS distance of the remaining vertex to all planes in
  /// its quadric.
  float error_m = std::numeric_limits<float>::infinity();
  /// Time limit. The result has the least error for the number of triangles reached by then. Not
  /// deterministic.
  std::optional<std::chrono::nanoseconds> time{};

  /// [V] importance of vertices, as a factor on the quadric error (hands and faces against walls);
  /// empty: all 1. With weight 4 the allowed error is half of error_m, and more of the target's
  /// triangles stay there. Over 0, at most a million.
  std::span<const float> weights{};
  /// [T] label of each triangle, such as its chunk; empty: none. Border lines between two labels
  /// are simplified first, each independently of the triangles beside it, so that neighbouring
  /// chunks always agree on them (docs/simplify.md, Lines between chunks).
  std::span<const std::uint32_t> chunks{};
  /// Largest distance that a border line between chunks may move, metres. When these lines need
  /// more triangles than the target allows, more triangles remain.
  float border_error_m = 0.0025f;
};

struct Simplified {
  Mesh mesh;                          ///< runs as in the input
  std::vector<std::uint32_t> chunks;  ///< [T] if the input had them
  std::vector<float> errors_m;  ///< [V] RMS distance of each vertex to the planes in its quadric
  float error_m = 0;            ///< the largest of them
};

/// Mesh decimation with quadric error metrics (Garland and Heckbert 1997; paper 3.1): half-edge
/// collapses, after which interior vertices move to the minimum of their quadric. Open borders only
/// lose vertices, within the error limit; runs stay together. No triangle flips, no edge gains
/// triangles, no hole closes and no component vanishes, so a mesh of many small components may keep
/// more triangles than the target. Input that meets the target already is returned unchanged, even
/// if degenerate. Parallel; the same bytes on any number of threads. Reuses its memory between
/// calls. invalid: a position is not finite or over 1000 km away, an index has no vertex, or
/// options do not match the mesh.
class Simplifier {
 public:
  Simplifier();
  ~Simplifier();
  Simplifier(Simplifier&&) noexcept;
  Simplifier& operator=(Simplifier&&) noexcept;

  Result<Simplified> run(const Mesh& mesh, const SimplifyOptions& options);
  /// Several levels of detail in one pass, one per entry of `triangles`, which must be descending
  /// and replaces options.triangles. Border lines between chunks are the same in all levels.
  Result<std::vector<Simplified>> run(const Mesh& mesh, std::span<const std::size_t> triangles,
                                      const SimplifyOptions& options);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The same for a single call.
Result<Simplified> simplify(const Mesh& mesh, const SimplifyOptions& options);

/// `ratio` times the mesh's triangles, rounded up. `ratio`: (0, 1].
std::size_t triangles_at(const Mesh& mesh, double ratio);

}  // namespace mr::simplify
