#include "mr/calib/clock_offsets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "mr/calib/motion.h"
#include "mr/core/parallel.h"

namespace mr::calib {
namespace {

constexpr std::size_t kBlocks = 10;  // of time, left out in turn
constexpr std::size_t kLeastFrames = 8;
constexpr double kMostTimeGap_s = 0.15;     // between the captures that are interpolated
constexpr double kMostTimeStep_m = 0.08;    // of the surface between them
constexpr double kMostSlope_m = 0.05;       // between neighbours of a pixel
constexpr double kFront_m = 0.03;           // what moves stands so far before the background
constexpr double kLeastClockFacing = 0.35;  // cosine
constexpr double kSlow_m_s = 0.1;
constexpr int kCoarseStride = 4;
constexpr double kCoarseScale_m = 0.025;  // half of the weight; calibration is not better than that
constexpr int kMostClockSteps = 20;
constexpr double kMostStep_s = 0.03;
constexpr double kConverged_s = 1e-5, kConverged_m = 1e-4;
constexpr double kModel_s = 0.0003;  // what interpolation between captures is off by, measured
constexpr double kMostRefinement_s = 0.15;  // away from the coarse search

/// A sensor with all that does not depend on the others.
struct ClockView {
  const DepthTrack* track = nullptr;
  Pose T_depth_world;
  std::vector<double> times_s;
  TrackSurface surface;
};

/// A few points on edges that flicker are no motion.
ClockView view_of(const DepthTrack& track, TimePoint epoch, std::size_t least_points) {
  ClockView view;
  view.track = &track;
  view.T_depth_world = track.T_world_depth.inverse();
  for (const TimePoint t : track.times)
    view.times_s.push_back(std::chrono::duration<double>(t - epoch).count());
  if (track.times.size() >= kLeastFrames) view.surface = surface_of(track, epoch);
  if (view.surface.moving.size() < least_points) view.surface.moving.clear();
  return view;
}

/// The ray of a sensor through a point.
struct Sighting {
  Vec2d pixel;
  double depth_m = 0;
  double facing_m = 0;  ///< along the normal, per metre of depth
};

std::optional<Sighting> sighting(const ClockView& view, const MovingPoint& point) {
  const Vec3d p = view.T_depth_world * point.position;
  if (!(p.z > 0.1)) return std::nullopt;
  const Vec3d ray = (point.position - view.track->T_world_depth.translation) / p.z;
  const double facing = -dot(ray, point.normal);
  if (facing < kLeastClockFacing * length(ray)) return std::nullopt;
  const Camera& c = view.track->camera;
  return Sighting{{p.x / p.z * c.fx + c.cx, p.y / p.z * c.fy + c.cy}, p.z, facing};
}

/// A point against the surface that another sensor sees.
struct ClockResidual {
  double behind_m = 0;   ///< along the normal
  double speed_m_s = 0;  ///< of the other sensor's surface, along the normal
};

/// At a moment of the other sensor's clock.
std::optional<ClockResidual> moving_residual(const ClockView& view, const MovingPoint& point,
                                             double time_s) {
  const auto next = std::ranges::upper_bound(view.times_s, time_s);
  if (next == view.times_s.begin() || next == view.times_s.end()) return std::nullopt;
  const std::size_t j = static_cast<std::size_t>(next - view.times_s.begin());
  const double gap_s = view.times_s[j] - view.times_s[j - 1];
  if (gap_s > kMostTimeGap_s) return std::nullopt;
  const auto seen = sighting(view, point);
  if (!seen) return std::nullopt;
  const auto before =
      smooth_depth(view.track->depth[j - 1], DepthTrack::kCount_m, seen->pixel, kMostSlope_m);
  if (!before) return std::nullopt;
  const auto after =
      smooth_depth(view.track->depth[j], DepthTrack::kCount_m, seen->pixel, kMostSlope_m);
  if (!after || std::abs(*after - *before) > kMostTimeStep_m) return std::nullopt;
  const double share = (time_s - view.times_s[j - 1]) / gap_s;
  const double depth_m = *before + (*after - *before) * share;
  const double behind_m = *view.surface.background.at(static_cast<int>(seen->pixel.x + 0.5),
                                                      static_cast<int>(seen->pixel.y + 0.5));
  if (behind_m > 0 && depth_m > behind_m - kFront_m) return std::nullopt;
  return ClockResidual{(seen->depth_m - depth_m) * seen->facing_m,
                       -(*after - *before) / gap_s * seen->facing_m};
}

std::optional<ClockResidual> resting_residual(const ClockView& view, const MovingPoint& point) {
  const auto seen = sighting(view, point);
  if (!seen) return std::nullopt;
  const auto depth_m = smooth_depth(view.surface.background, 1, seen->pixel, kMostSlope_m);
  if (!depth_m) return std::nullopt;
  return ClockResidual{(seen->depth_m - *depth_m) * seen->facing_m, 0};
}

// ---- coarse search

/// How well two sensors agree, by the difference of their clocks in steps of the search.
struct CoarseScores {
  std::size_t a = 0, b = 0;
  std::vector<double> scores;  ///< [2 * steps + 1], 0: no overlap
  double best() const { return *std::ranges::max_element(scores); }
  int best_step() const {
    return static_cast<int>(std::ranges::max_element(scores) - scores.begin()) -
           static_cast<int>(scores.size() / 2);
  }
  double at(int step) const {
    const int i = step + static_cast<int>(scores.size() / 2);
    return i < 0 || i >= static_cast<int>(scores.size()) ? 0 : scores[i];
  }
};

/// Points of one sensor in pictures of another.
struct Agreement {
  double count = 0, close = 0;  ///< those compared, and how many of them are close

  /// A moment when more is seen wins only if it fits as well.
  double score() const { return count > 0 ? close * close / count : 0; }
};

void add_agreement(const ClockView& of, const ClockView& in, double lag_s, double gate_m,
                   Agreement& sum) {
  for (std::size_t i = 0; i < of.surface.moving.size(); i += kCoarseStride) {
    const MovingPoint& point = of.surface.moving[i];
    const auto residual = moving_residual(in, point, point.time_s + lag_s);
    if (!residual || std::abs(residual->behind_m) > gate_m) continue;
    const double share = residual->behind_m / kCoarseScale_m;
    ++sum.count;
    sum.close += 1 / (1 + share * share);
  }
}

CoarseScores coarse_scores(std::span<const ClockView> views, std::size_t a, std::size_t b,
                           const ClockConfig& config) {
  CoarseScores out{a, b, {}};
  const int steps = static_cast<int>(std::ceil(config.most_offset_s / config.coarse_step_s));
  for (int step = -steps; step <= steps; ++step) {
    const double lag_s = step * config.coarse_step_s;
    Agreement agreement;
    add_agreement(views[a], views[b], lag_s, config.gate_m, agreement);
    add_agreement(views[b], views[a], -lag_s, config.gate_m, agreement);
    out.scores.push_back(agreement.score());
  }
  return out;
}

/// Offsets in steps of the search that suit all pairs: along the strongest pairs first, then each
/// sensor by itself where the sum of the scores is largest.
std::vector<int> coarse_offsets(std::span<const CoarseScores> pairs, std::size_t sensors) {
  std::vector<const CoarseScores*> sorted;
  for (const CoarseScores& pair : pairs) sorted.push_back(&pair);
  std::ranges::stable_sort(sorted, std::greater{}, [](const auto* p) { return p->best(); });
  std::vector<int> offset(sensors, 0);
  std::vector<std::size_t> tree(sensors);
  for (std::size_t i = 0; i < sensors; ++i) tree[i] = i;
  for (const CoarseScores* pair : sorted) {
    if (tree[pair->a] == tree[pair->b]) continue;
    const int shift = offset[pair->b] + pair->best_step() - offset[pair->a];
    const std::size_t joined = tree[pair->a];
    for (std::size_t i = 0; i < sensors; ++i)
      if (tree[i] == joined) tree[i] = tree[pair->b], offset[i] += shift;
  }
  for (int round = 0; round < 10; ++round)
    for (std::size_t s = 0; s < sensors; ++s) {
      const auto sum_at = [&](int at) {
        double sum = 0;
        for (const CoarseScores& pair : pairs) {
          if (pair.a == s) sum += pair.at(at - offset[pair.b]);
          if (pair.b == s) sum += pair.at(offset[pair.a] - at);
        }
        return sum;
      };
      int best = offset[s];
      for (int step = -3; step <= 3; ++step)
        if (sum_at(offset[s] + step) > sum_at(best)) best = offset[s] + step;
      offset[s] = best;
    }
  return offset;
}

// ---- fine estimate of one pair

constexpr std::size_t kUnknowns = 8;  // turn and shift of a against b, depth, clock
constexpr std::size_t kDepthUnknown = 6, kClockUnknown = 7;
using ClockRow = std::array<double, kUnknowns>;

/// Normal equations of an instrumental-variable estimate, not symmetric.
struct ClockEquations {
  std::array<ClockRow, kUnknowns> matrix{};
  ClockRow right{};

  void add(const ClockRow& instrument, const ClockRow& derivative, double residual, double weight) {
    for (std::size_t i = 0; i < kUnknowns; ++i) {
      for (std::size_t j = 0; j < kUnknowns; ++j)
        matrix[i][j] += weight * instrument[i] * derivative[j];
      right[i] -= weight * instrument[i] * residual;
    }
  }
  void add(const ClockEquations& other, double factor = 1) {
    for (std::size_t i = 0; i < kUnknowns; ++i) {
      for (std::size_t j = 0; j < kUnknowns; ++j) matrix[i][j] += factor * other.matrix[i][j];
      right[i] += factor * other.right[i];
    }
  }
};

/// Gaussian elimination with row pivots; nothing where singular.
std::optional<ClockRow> solved_row(ClockEquations e) {
  for (std::size_t k = 0; k < kUnknowns; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < kUnknowns; ++i)
      if (std::abs(e.matrix[i][k]) > std::abs(e.matrix[pivot][k])) pivot = i;
    std::swap(e.matrix[k], e.matrix[pivot]);
    std::swap(e.right[k], e.right[pivot]);
    if (!(std::abs(e.matrix[k][k]) > 1e-12)) return std::nullopt;
    for (std::size_t i = k + 1; i < kUnknowns; ++i) {
      const double factor = e.matrix[i][k] / e.matrix[k][k];
      for (std::size_t j = k; j < kUnknowns; ++j) e.matrix[i][j] -= factor * e.matrix[k][j];
      e.right[i] -= factor * e.right[k];
    }
  }
  ClockRow x{};
  for (std::size_t k = kUnknowns; k-- > 0;) {
    x[k] = e.right[k];
    for (std::size_t j = k + 1; j < kUnknowns; ++j) x[k] -= e.matrix[k][j] * x[j];
    x[k] /= e.matrix[k][k];
  }
  return x;
}

/// One compared point.
struct ClockMatch {
  ClockRow instrument{}, derivative{};
  double residual_m = 0;
  std::size_t block = 0;
  bool moves = false;
};

struct ClockFit {
  const ClockView *a = nullptr, *b = nullptr;
  Vec3d middle;  ///< motions turn about it
  Pose moved;    ///< what corrects the points of a, world frame; those of b by the inverse
  double start_s = 0, end_s = 0;
  ClockRow x{};  ///< the last is the offset of a against b, in seconds
  std::vector<ClockMatch> matches;
};

/// `sign`: 1 for points of a in pictures of b.
ClockMatch match_of(const ClockFit& fit, const MovingPoint& point, const ClockResidual& residual,
                    double sign, bool moves) {
  ClockMatch out;
  const Vec3d turn = cross(point.position - fit.middle, point.normal) / kArm_m;
  for (int i = 0; i < 3; ++i)
    out.derivative[i] = -sign * turn[i], out.derivative[3 + i] = -sign * point.normal[i];
  out.derivative[kDepthUnknown] = moves ? 1 : 0;
  out.instrument = out.derivative;
  out.derivative[kClockUnknown] = sign * residual.speed_m_s;
  out.instrument[kClockUnknown] = sign * point.speed_m_s;
  out.residual_m = residual.behind_m;
  out.moves = moves;
  return out;
}

/// What is left of a residual; it was measured with the present motion and clock.
double left_over_m(const ClockFit& fit, const ClockMatch& match) {
  return match.residual_m + match.derivative[kDepthUnknown] * fit.x[kDepthUnknown];
}

/// A small motion in place of one that is linearized: turned by Rodrigues' formula about `middle`.
Pose small_motion(const ClockRow& step, Vec3d middle) {
  const Vec3d turn = Vec3d{step[0], step[1], step[2]} / kArm_m;
  const double angle = length(turn), c = std::cos(angle), s = std::sin(angle);
  const auto [x, y, z] = normalized(turn);
  Pose out;
  out.rotation = {{c + x * x * (1 - c), x * y * (1 - c) - z * s, x * z * (1 - c) + y * s,
                   y * x * (1 - c) + z * s, c + y * y * (1 - c), y * z * (1 - c) - x * s,
                   z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c)}};
  out.translation = middle + Vec3d{step[3], step[4], step[5]} - out.rotation * middle;
  return out;
}

MovingPoint moved(const Pose& T, MovingPoint point) {
  point.position = T * point.position;
  point.normal = T.rotation * point.normal;
  return point;
}

void add_matches(ClockFit& fit, const ClockView& of, const ClockView& in, double sign,
                 double gate_m) {
  const auto keep = [&](ClockMatch match) {
    if (std::abs(left_over_m(fit, match)) < gate_m) fit.matches.push_back(match);
  };
  const Pose T = sign > 0 ? fit.moved : fit.moved.inverse();
  for (const MovingPoint& stated : of.surface.moving) {
    const MovingPoint point = moved(T, stated);
    const auto residual = moving_residual(in, point, point.time_s + sign * fit.x[kClockUnknown]);
    if (!residual) continue;
    ClockMatch match = match_of(fit, point, *residual, sign, true);
    const double part = (point.time_s - fit.start_s) / (fit.end_s - fit.start_s);
    match.block = static_cast<std::size_t>(std::clamp(part, 0.0, 0.999) * kBlocks);
    keep(match);
  }
  for (const MovingPoint& stated : of.surface.resting) {
    const MovingPoint point = moved(T, stated);
    if (const auto residual = resting_residual(in, point))
      keep(match_of(fit, point, *residual, sign, false));
  }
}

/// Tukey's scale: 4.7 standard deviations from the median of what is left over.
double tukey_scale_m(const ClockFit& fit, bool moves) {
  std::vector<double> sizes;
  for (const ClockMatch& match : fit.matches)
    if (match.moves == moves) sizes.push_back(std::abs(left_over_m(fit, match)));
  if (sizes.empty()) return 1;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::ranges::nth_element(sizes, middle);
  return 4.685 * std::max(1.4826 * *middle, 0.001);
}

/// By block of time, and the resting points, which weigh as much as all others together.
struct ClockBlocks {
  std::array<ClockEquations, kBlocks> moving;
  ClockEquations always;
};

ClockBlocks equations_of(const ClockFit& fit) {
  ClockBlocks out;
  ClockEquations resting;
  double moving_weight = 0, resting_weight = 0;
  const double moving_scale_m = tukey_scale_m(fit, true),
               resting_scale_m = tukey_scale_m(fit, false);
  for (const ClockMatch& match : fit.matches) {
    const double residual_m = left_over_m(fit, match);
    const double share = residual_m / (match.moves ? moving_scale_m : resting_scale_m);
    if (std::abs(share) >= 1) continue;
    const double weight = (1 - share * share) * (1 - share * share);
    (match.moves ? out.moving[match.block] : resting)
        .add(match.instrument, match.derivative, residual_m, weight);
    (match.moves ? moving_weight : resting_weight) += weight;
  }
  if (resting_weight > 0) out.always.add(resting, moving_weight / resting_weight);
  // A weak prior: motions of 2 cm and 1 degree against residuals of 1 cm.
  for (std::size_t i = 0; i < kClockUnknown; ++i) {
    out.always.matrix[i][i] += 0.25;
    out.always.right[i] -= 0.25 * fit.x[i];
  }
  return out;
}

/// The step of the unknowns, without one block of time.
std::optional<ClockRow> step_without(const ClockBlocks& equations, std::size_t left_out) {
  ClockEquations sum = equations.always;
  for (std::size_t i = 0; i < kBlocks; ++i)
    if (i != left_out) sum.add(equations.moving[i]);
  return solved_row(sum);
}

/// A pair's clocks with all, and with all but one block of time.
struct PairClock {
  ClockPair pair;
  std::array<double, kBlocks> without_s{};
};

double jackknife_sigma(std::span<const double> values) {
  double mean = 0, sum = 0;
  for (const double v : values) mean += v / static_cast<double>(values.size());
  for (const double v : values) sum += (v - mean) * (v - mean);
  const double n = static_cast<double>(values.size());
  return std::sqrt((n - 1) / n * sum);
}

std::size_t points_in_motion(const ClockFit& fit) {
  return static_cast<std::size_t>(std::ranges::count_if(fit.matches, [](const ClockMatch& match) {
    return match.moves && std::abs(match.instrument[kClockUnknown]) > kSlow_m_s;
  }));
}

ClockFit begin_fit(const ClockView& a, const ClockView& b, double offset_s) {
  ClockFit fit;
  fit.a = &a, fit.b = &b;
  fit.x[kClockUnknown] = offset_s;
  fit.start_s = std::max(a.times_s.front(), b.times_s.front());
  fit.end_s = std::max(fit.start_s + 1e-3, std::min(a.times_s.back(), b.times_s.back()));
  double count = 0;
  for (const ClockView* view : {&a, &b})
    for (const MovingPoint& point : view->surface.moving) fit.middle += point.position, ++count;
  fit.middle = fit.middle / std::max(count, 1.0);
  return fit;
}

bool is_small(const ClockRow& step) {
  return std::abs(step[kClockUnknown]) < kConverged_s &&
         std::all_of(step.begin(), step.begin() + kClockUnknown,
                     [](double x) { return std::abs(x) < kConverged_m; });
}

std::optional<PairClock> pair_clock(std::span<const ClockView> views, std::size_t a, std::size_t b,
                                    double coarse_s, const ClockConfig& config) {
  ClockFit fit = begin_fit(views[a], views[b], coarse_s);
  ClockBlocks equations;
  for (int i = 0; i < kMostClockSteps; ++i) {
    fit.matches.clear();
    add_matches(fit, views[a], views[b], 1, config.gate_m);
    add_matches(fit, views[b], views[a], -1, config.gate_m);
    if (points_in_motion(fit) < config.least_points) return std::nullopt;
    equations = equations_of(fit);
    const auto step = step_without(equations, kBlocks);
    if (!step) return std::nullopt;
    fit.moved = small_motion(*step, fit.middle) * fit.moved;
    for (std::size_t k = 0; k < kUnknowns; ++k)
      fit.x[k] +=
          k == kClockUnknown ? std::clamp((*step)[k], -kMostStep_s, kMostStep_s) : (*step)[k];
    if (std::abs(fit.x[kClockUnknown] - coarse_s) > kMostRefinement_s) return std::nullopt;
    if (is_small(*step)) break;
  }
  PairClock out;
  for (std::size_t i = 0; i < kBlocks; ++i) {
    const auto step = step_without(equations, i);
    if (!step) return std::nullopt;
    out.without_s[i] = fit.x[kClockUnknown] + (*step)[kClockUnknown];
  }
  out.pair = {a, b, fit.x[kClockUnknown], jackknife_sigma(out.without_s), points_in_motion(fit)};
  return out;
}

// ---- all pairs together

/// The sensors that pairs connect with each other, the largest group.
std::vector<std::size_t> largest_group(std::span<const PairClock> pairs, std::size_t sensors) {
  std::vector<std::size_t> group(sensors), size(sensors, 0);
  for (std::size_t i = 0; i < sensors; ++i) group[i] = i;
  for (const PairClock& p : pairs) {
    const std::size_t from = group[p.pair.a], to = group[p.pair.b];
    for (std::size_t& g : group)
      if (g == from) g = to;
  }
  for (const std::size_t g : group) ++size[g];
  const std::size_t largest =
      static_cast<std::size_t>(std::ranges::max_element(size) - size.begin());
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < sensors; ++i)
    if (group[i] == largest) out.push_back(i);
  return out;
}

/// Weighted least squares for the offsets of a connected group, whose first member has 0, by
/// Gauss-Seidel sweeps. `offset_of(pair)`: seconds; `weights`: of the pairs.
template <typename OffsetOf>
std::vector<double> graph_offsets(std::span<const PairClock> pairs, std::span<const double> weights,
                                  std::size_t sensors, std::size_t reference,
                                  const OffsetOf& offset_of) {
  constexpr int kMostSweeps = 10'000;
  std::vector<double> x(sensors, 0);
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    std::vector<double> sum(sensors, 0), weight(sensors, 0);
    double change = 0;
    for (std::size_t s = 0; s < sensors; ++s) {
      if (s == reference) continue;
      double top = 0, bottom = 0;
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        const ClockPair& p = pairs[i].pair;
        if (p.a == s) top += weights[i] * (x[p.b] + offset_of(pairs[i])), bottom += weights[i];
        if (p.b == s) top += weights[i] * (x[p.a] - offset_of(pairs[i])), bottom += weights[i];
      }
      if (!(bottom > 0)) continue;
      change = std::max(change, std::abs(top / bottom - x[s]));
      x[s] = top / bottom;
    }
    if (change < 1e-8) break;
  }
  return x;
}

/// Pairs that contradict the others weigh less (Cauchy).
std::vector<double> robust_weights(std::span<const PairClock> pairs, std::size_t sensors,
                                   std::size_t reference) {
  constexpr double kFloor_s = 0.0005, kScale_s = 0.002;
  std::vector<double> weights;
  for (const PairClock& p : pairs)
    weights.push_back(1e-6 / (p.pair.sigma_s * p.pair.sigma_s + kFloor_s * kFloor_s));
  const std::vector<double> plain = weights;
  for (int round = 0; round < 5; ++round) {
    const auto x = graph_offsets(pairs, weights, sensors, reference,
                                 [](const PairClock& p) { return p.pair.offset_s; });
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const ClockPair& p = pairs[i].pair;
      const double off = (p.offset_s - x[p.a] + x[p.b]) / std::max(2 * p.sigma_s, kScale_s);
      weights[i] = plain[i] / (1 + off * off);
    }
  }
  return weights;
}

std::string problem_of(const ClockView& view) {
  if (view.times_s.size() < kLeastFrames) return "it has too few pictures";
  if (view.surface.moving.empty()) return "it sees nothing that moves";
  return "no other sensor sees the same things move";
}

void combine(std::span<const PairClock> pairs, const ClockConfig& config, ClockEstimate& out) {
  const std::size_t sensors = out.clocks.size();
  const auto group = largest_group(pairs, sensors);
  out.reference = group.front();
  const auto weights = robust_weights(pairs, sensors, group.front());
  const auto x = graph_offsets(pairs, weights, sensors, group.front(),
                               [](const PairClock& p) { return p.pair.offset_s; });
  std::vector<std::vector<double>> without(kBlocks);
  for (std::size_t block = 0; block < kBlocks; ++block)
    without[block] = graph_offsets(pairs, weights, sensors, group.front(),
                                   [block](const PairClock& p) { return p.without_s[block]; });
  for (const std::size_t s : group) {
    std::array<double, kBlocks> values{};
    for (std::size_t block = 0; block < kBlocks; ++block) values[block] = without[block][s];
    ClockOffset& clock = out.clocks[s];
    clock.sigma_s = s == group.front() ? 0 : std::hypot(jackknife_sigma(values), kModel_s);
    clock.problem.clear();
    if (clock.sigma_s <= config.most_sigma_s)
      clock.offset_s = x[s];
    else
      clock.problem = "too little moves where another sensor sees it, too";
  }
  for (const PairClock& p : pairs) {
    out.pairs.push_back(p.pair);
    out.clocks[p.pair.a].shared_points += p.pair.points;
    out.clocks[p.pair.b].shared_points += p.pair.points;
  }
}

/// All pairs, those without overlap without scores.
std::vector<CoarseScores> all_coarse_scores(std::span<const ClockView> views,
                                            const ClockConfig& config) {
  std::vector<CoarseScores> all;
  for (std::size_t a = 0; a < views.size(); ++a)
    for (std::size_t b = a + 1; b < views.size(); ++b)
      if (!views[a].surface.moving.empty() && !views[b].surface.moving.empty())
        all.push_back({a, b, {}});
  parallel_for(all.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      all[i] = coarse_scores(views, all[i].a, all[i].b, config);
  });
  std::erase_if(all, [](const CoarseScores& pair) { return pair.best() <= 0; });
  return all;
}

}  // namespace

ClockEstimate estimate_clock_offsets(std::span<const DepthTrack> tracks,
                                     const ClockConfig& config) {
  TimePoint epoch = TimePoint::max();
  for (const DepthTrack& track : tracks)
    if (!track.times.empty()) epoch = std::min(epoch, track.times.front());
  std::vector<ClockView> views(tracks.size());
  parallel_for(tracks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      views[i] = view_of(tracks[i], epoch, config.least_points);
  });
  const auto coarse = all_coarse_scores(views, config);
  const auto steps = coarse_offsets(coarse, views.size());
  std::vector<std::optional<PairClock>> fits(coarse.size());
  parallel_for(coarse.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      fits[i] =
          pair_clock(views, coarse[i].a, coarse[i].b,
                     (steps[coarse[i].a] - steps[coarse[i].b]) * config.coarse_step_s, config);
  });
  ClockEstimate out;
  out.clocks.resize(tracks.size());
  for (std::size_t i = 0; i < views.size(); ++i) out.clocks[i].problem = problem_of(views[i]);
  std::vector<PairClock> pairs;
  for (const auto& fit : fits)
    if (fit) pairs.push_back(*fit);
  if (pairs.empty())
    out.problem = std::ranges::all_of(views, [](const auto& v) { return v.surface.moving.empty(); })
                      ? "nothing moves"
                      : "no two sensors see the same things move";
  else
    combine(pairs, config, out);
  return out;
}

}  // namespace mr::calib
