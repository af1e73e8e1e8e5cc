#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "mr/atlas/color_sampler.h"
#include "mr/core/mesh.h"
#include "mr/core/view.h"

namespace mr::atlas {

/// How much two views' colours differ at the middles of a mesh's edges. Pictures are sampled where
/// that is asked for, once. One thread.
class SeamColors {
 public:
  /// `sampler` null: no differences. All must outlive this.
  SeamColors(const Mesh& mesh, std::span<const View> views, const ColorSampler* sampler);

  /// The mean difference over red, green and blue, 0..1, at the edge of a half-edge; a metric in
  /// the views. A view without a picture there counts as mid grey.
  float difference(std::uint32_t half_edge, int view_a, int view_b);

 private:
  static constexpr std::uint32_t kUnknown = 0;

  std::uint32_t color(std::uint32_t half_edge, int view);

  const Mesh& mesh_;
  std::span<const View> views_;
  const ColorSampler* sampler_;
  std::vector<std::uint32_t> known_;  ///< [3T * views] red, green, blue and a mark; kUnknown
};

/// The choice of views as a labelling problem (Lempitsky and Ivanov 2007): each triangle takes a
/// view; the sum of the triangles' costs and of the seams' costs is to be least.
struct LabelProblem {
  static constexpr int kNone = -1;
  static constexpr float kNotAllowed = std::numeric_limits<float>::infinity();
  /// Cost of a metre of seam, in m² of surface that is as badly seen as can be.
  static constexpr float kSeam_m = 0.007f;
  /// How much dearer a seam is where its views differ by all of the colour range.
  static constexpr float kPerDifference = 30;

  const Mesh* mesh = nullptr;
  std::size_t views = 0;
  std::vector<float> cost;             ///< [T * views] m²; kNotAllowed
  std::vector<float> area_m2;          ///< [T]
  std::vector<std::uint8_t> may_move;  ///< [T] 0: keeps its label
  std::vector<std::uint32_t> twin;     ///< [3T] kit::EdgeTable::twin
  SeamColors* colors = nullptr;        ///< null: colours do not count

  float cost_of(std::size_t t, int view) const {
    return cost[t * views + static_cast<std::size_t>(view)];
  }
  bool allows(std::size_t t, int view) const { return cost_of(t, view) < kNotAllowed; }
  /// Cost of an edge between triangles with these labels, m²; none to or from kNone.
  float seam(std::uint32_t half_edge, int a, int b) const;
};

/// The sum that solve_labels() makes small, m².
double energy(const LabelProblem& problem, std::span<const int> label);

/// Chooses labels: iterated conditional modes for triangles (Besag 1986) and for regions, that is,
/// connected triangles of one label, the smallest first. Afterwards no region is smaller than
/// `least_region_m2` that its neighbours' labels could replace; regions that contain a triangle
/// that may not move, or that end at no other label, are not looked at. `label` [T]: the start,
/// an allowed label or kNone, which stays. Deterministic; one thread.
void solve_labels(const LabelProblem& problem, double least_region_m2, std::vector<int>& label);

}  // namespace mr::atlas
