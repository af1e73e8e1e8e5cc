#include "mr/simplify/reduce.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "mr/simplify/compact.h"

namespace mr::simplify {

namespace {

constexpr std::size_t kFew =
    256;  // triangles: the last ones are removed one by one, cheapest first
// How many vertices a round considers, so that no more than necessary are removed:
constexpr double kCare = 0.9;  // times the number that suffices at the last round's success rate,
constexpr double kMostFirst = 0.9;   // at most this share of all vertices in the first round
constexpr double kMostLater = 0.65;  // and in later rounds
// Before the first round, one in kTrialStep blocks of vertices is tried to estimate the success
// rate.
constexpr std::uint32_t kTrialBlock = 512, kTrialStep = 8;
constexpr double kFewest = 0.35;        // lower bound of the assumed success rate, which fluctuates
constexpr double kLeastSuccess = 0.02;  // below this rate, rounds end
// When less than kCrowded of the array of vertices is left, it is compacted,
constexpr double kCrowded = 0.55;
constexpr double kWorthwhile = 0.2;            // if this share of the rest is still to be removed
constexpr std::uint32_t kSamples = 65536;      // vertices from which a cost limit is estimated
constexpr std::uint32_t kRatedSamples = 4096;  // the same if their costs must be computed for it
constexpr float kRetry = 4;  // blocked vertices below this multiple of the limit are retried
constexpr float kLeastCost = 1e-30f;

/// A vertex's number, well mixed.
std::uint32_t shuffled(std::uint32_t v) {
  v = (v ^ v >> 16) * 0x7FEB352Du;
  v = (v ^ v >> 15) * 0x846CA68Bu;
  return v ^ v >> 16;
}

/// The vertices that a round collapses: all with a cost under `below`, and a random fraction of
/// those up to `most`, which are nearly equal. Otherwise a flat wall, where all costs are 0, would
/// collapse in one round.
struct Limit {
  float below = 0, most = 0;
  std::uint32_t share = 0;  ///< of 2^32

  static Limit upto(float cost) { return {cost, cost, 0xFFFFFFFFu}; }

  bool takes(float cost, std::uint32_t v) const {
    return cost < below || (cost <= most && shuffled(v) <= share);
  }
};

/// Histogram of costs by their bits: non-negative floats sort like their bit patterns.
class Histogram {
 public:
  void add(float cost) { ++count_[std::bit_cast<std::uint32_t>(cost) >> kShift]; }
  /// The cost limit below which `wanted` of the costs lie.
  Limit limit(double wanted) const {
    double under = 0;
    for (std::uint32_t bin = 0; bin < kBins; ++bin) {
      if (under + count_[bin] < wanted) {
        under += count_[bin];
        continue;
      }
      const double share = count_[bin] > 0 ? (wanted - under) / count_[bin] : 0;
      return {std::bit_cast<float>(bin << kShift), std::bit_cast<float>(((bin + 1) << kShift) - 1),
              static_cast<std::uint32_t>(std::min(share * 0x1p32, 0x1p32 - 1))};
    }
    return {kNever, std::numeric_limits<float>::max(), 0};
  }

 private:
  static constexpr int kShift = 19;  // 16 bins per doubling
  static constexpr std::uint32_t kBins = 0x7F800000u >> kShift;

  std::array<std::uint32_t, kBins + 1> count_{};  // the last: kNever
};

/// The limit below which about `wanted` vertices lie, estimated from a sample, whose costs are
/// computed if necessary.
Limit find_limit(double wanted, bool rated, WorkingMesh& mesh) {
  const std::uint32_t step = std::max(1u, mesh.vertices() / (rated ? kSamples : kRatedSamples));
  Histogram costs;
  EdgeCollapser collapser(mesh);
  for (std::uint32_t v = step / 2; v < mesh.vertices(); v += step)
    costs.add(rated || mesh.next[v] == kNever ? mesh.next[v] : collapser.rate(v));
  return costs.limit(wanted / step);
}

/// The deadline, shared by all threads.
class DeadlineClock {
 public:
  explicit DeadlineClock(const StopCriteria& goal) : deadline_(goal.deadline) {}
  bool is_over() const { return over_.load(std::memory_order_relaxed); }
  void tick() {
    if (deadline_ && std::chrono::steady_clock::now() >= *deadline_) over_ = true;
  }

 private:
  std::optional<std::chrono::steady_clock::time_point> deadline_;
  std::atomic<bool> over_ = false;
};

/// Collapses v into a neighbour if the cost is within the limit; otherwise stores the cost at which
/// to try again. Returns the number of triangles removed.
std::uint32_t try_collapse(std::uint32_t v, const Limit& limit, float error_m,
                           EdgeCollapser& collapser, WorkingMesh& mesh) {
  const float cost = collapser.rate(v);
  if (!limit.takes(cost, v)) {
    mesh.next[v] = cost;
    return 0;
  }
  const std::uint32_t gone = collapser.collapse(limit.most, error_m);
  if (gone == 0) mesh.next[v] = std::max(limit.most, kLeastCost) * kRetry;
  return gone;
}

/// One round over all vertices, or a trial on a sample. Returns the number of triangles removed.
std::size_t run_round(const Limit& limit, bool trial, const StopCriteria& goal,
                      DeadlineClock& clock, ParallelSweep& sweep, WorkingMesh& mesh) {
  const auto wanted = [&](std::uint32_t v) {
    return limit.takes(mesh.next[v], v) && (!trial || v / kTrialBlock % kTrialStep == 0);
  };
  const std::size_t budget = mesh.triangles - goal.triangles;
  return sweep.run(mesh, budget, wanted, [&](EdgeCollapser& collapser, std::uint32_t v) {
    if (v % 64 == 0) clock.tick();
    return clock.is_over() ? 0 : try_collapse(v, limit, goal.error_m, collapser, mesh);
  });
}

/// Collapses the cheapest vertices serially, in order of cost, until the goal is met. False: none
/// could be collapsed.
bool take_cheapest(std::size_t most, const StopCriteria& goal, DeadlineClock& clock,
                   WorkingMesh& mesh) {
  struct Candidate {
    float cost;
    std::uint32_t order, v;
    bool operator<(const Candidate& other) const {
      return std::pair(cost, order) < std::pair(other.cost, other.order);
    }
  };
  std::vector<Candidate> candidates;
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v)
    if (mesh.next[v] < kNever) candidates.push_back({mesh.next[v], shuffled(v), v});
  most = std::min(most, candidates.size());
  std::partial_sort(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(most),
                    candidates.end());
  candidates.resize(most);
  bool any = false;
  float enough = kNever;  // costlier vertices wait until blocked ones are retried
  EdgeCollapser collapser(mesh);
  for (const Candidate& candidate : candidates) {
    if (mesh.triangles <= goal.triangles || clock.is_over()) return true;
    if (candidate.cost > enough) break;
    if (mesh.next[candidate.v] == kNever) continue;
    const std::uint32_t gone = try_collapse(candidate.v, Limit::upto(candidates.back().cost),
                                            goal.error_m, collapser, mesh);
    mesh.triangles -= gone;
    if (gone > 0 && !any) any = true, enough = kRetry * std::max(candidate.cost, kLeastCost);
    clock.tick();
  }
  return any;
}

}  // namespace

void reduce(const StopCriteria& goal, ParallelSweep& sweep, WorkingMesh& mesh, WorkingMesh& spare,
            std::vector<std::uint32_t>& number) {
  const std::size_t nearly = goal.triangles + std::max(goal.triangles / 128, kFew);
  DeadlineClock clock(goal);
  double success = 1;
  for (int round = 0; mesh.triangles > nearly && !clock.is_over(); ++round) {
    const bool trial = round == 0, first = round == 1;
    const double vertices = static_cast<double>(mesh.triangles) / 2;
    const double to_go = static_cast<double>(mesh.triangles - goal.triangles) / 2;
    if (vertices < kCrowded * mesh.vertices() && to_go > kWorthwhile * vertices) {
      compact(mesh, number, spare);
      std::swap(mesh, spare);
    }
    const double wanted =
        trial ? std::min(to_go, kMostLater * vertices)
              : std::min(kCare * to_go / success, (first ? kMostFirst : kMostLater) * vertices);
    const Limit limit = find_limit(wanted, !trial && !first, mesh);
    const std::size_t gone = run_round(limit, trial, goal, clock, sweep, mesh);
    mesh.triangles -= gone;
    success = static_cast<double>(gone) / 2 / (trial ? wanted / kTrialStep : wanted);
    if (!trial && success < kLeastSuccess) break;
    success = std::clamp(success, kFewest, 1.0);
  }
  std::size_t most = 4 * kFew;
  while (mesh.triangles > goal.triangles && !clock.is_over()) {
    const bool all = most >= mesh.vertices();
    most = std::max(most, mesh.triangles - goal.triangles);
    if (take_cheapest(most, goal, clock, mesh)) continue;
    if (all) break;
    most *= 4;
  }
}

void relax(ParallelSweep& sweep, WorkingMesh& mesh) {
  const auto wanted = [&](std::uint32_t v) {
    return mesh.places[v].error > 0 && mesh.rings.alive(v) && mesh.kinds[v] == VertexKind::inner;
  };
  sweep.run(mesh, mesh.vertices(), wanted, [](EdgeCollapser& collapser, std::uint32_t v) {
    collapser.relax(v);
    return 0u;
  });
}

}  // namespace mr::simplify
