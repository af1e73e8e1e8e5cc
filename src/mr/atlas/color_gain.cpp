#include "mr/atlas/color_gain.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "mr/atlas/srgb.h"
#include "mr/atlas/view_observations.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"

namespace mr::atlas {
namespace {

constexpr std::size_t kSamplesPerView = 1024, kMostSamples = 32768;
constexpr float kSimilarFacing = 0.2f;
constexpr double kFewSamples = 4,
                 kEnoughSamples = 20;  // from kEnoughSamples on a pair has full weight
constexpr double kPairError = 0.02;    // least error of a pair's log ratio
constexpr double kPriorError = 0.5;    // standard deviation of the prior: log gain 0
constexpr double kMostGain = 3;
constexpr double kShare = 1.0 / 30;  // exponential smoothing factor per frame
constexpr double kDeadBand = 0.006;  // of the log gain: half a step of bright sRGB
constexpr double kArrived = 0.001;
constexpr double kSeamStep_m = 0.01;

/// The log ratio of a point's light in two views.
struct Difference {
  double value = 0;  ///< difference of logarithms
  double weight = 0;
};

/// Weighted median; sorts its argument.
double median(std::vector<Difference>& of) {
  std::sort(of.begin(), of.end(), [](const Difference& a, const Difference& b) {
    return std::pair(a.value, a.weight) < std::pair(b.value, b.weight);
  });
  double left = 0;
  for (const Difference& d : of) left += 0.5 * d.weight;
  for (const Difference& d : of)
    if ((left -= d.weight) <= 0) return d.value;
  return 0;
}

struct RobustEstimate {
  double mean = 0, spread = 0;
};

/// A robust mean: of the values within twice the scaled median absolute deviation of the median.
RobustEstimate robust_mean(std::vector<Difference> of) {
  const double middle = median(of);
  std::vector<Difference> off = of;
  for (Difference& d : off) d.value = std::abs(d.value - middle);
  const double spread = 1.4826 * median(off);  // = the standard deviation, for a Gaussian
  double sum = 0, weight = 0;
  for (const Difference& d : of)
    if (std::abs(d.value - middle) <= 2 * spread) sum += d.weight * d.value, weight += d.weight;
  return {weight > 0 ? sum / weight : middle, spread};
}

/// Two views that overlap, with the differences at their common samples.
struct Pair {
  std::size_t first = 0, second = 0;
  std::array<std::vector<Difference>, 3> samples;  ///< first minus second, by channel
  Vec3d log_ratio;
  double weight = 0;  ///< 1 / variance
};

void estimate_difference(Pair& pair) {
  double spread = 0, count = 0;
  for (int c = 0; c < 3; ++c) {
    const RobustEstimate robust = robust_mean(pair.samples[c]);
    pair.log_ratio[c] = robust.mean;
    spread = std::max(spread, robust.spread);
  }
  for (const Difference& d : pair.samples[0]) count += d.weight;
  const double trust = std::clamp((count - kFewSamples) / (kEnoughSamples - kFewSamples), 0.0, 1.0);
  if (trust > 0) pair.weight = trust / (spread * spread / count + kPairError * kPairError);
}

std::vector<Pair> find_pairs(const std::vector<std::vector<Observation>>& observations) {
  std::map<std::pair<std::size_t, std::size_t>, Pair> found;
  for (const std::vector<Observation>& views : observations)
    for (std::size_t i = 0; i < views.size(); ++i)
      for (std::size_t j = i + 1; j < views.size(); ++j) {
        const Observation &a = views[i], &b = views[j];
        Pair& pair = found[{a.view, b.view}];
        pair.first = a.view, pair.second = b.view;
        const float unlike = (a.facing - b.facing) / kSimilarFacing;
        const double weight =
            a.facing * b.facing * std::min(a.level, b.level) / (1 + unlike * unlike);
        for (int c = 0; c < 3; ++c)
          pair.samples[c].push_back({a.log_light[c] - b.log_light[c], weight});
      }
  std::vector<Pair> out;
  for (auto& [key, pair] : found) out.push_back(std::move(pair));
  parallel_for(out.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) estimate_difference(out[i]);
  });
  std::erase_if(out, [](const Pair& pair) { return pair.weight == 0; });
  return out;
}

/// Solves A x = b for three right-hand sides by Cholesky decomposition. A ([n * n], lower half
/// used) must be positive definite and is overwritten.
std::vector<Vec3d> solve(std::vector<double> a, std::vector<Vec3d> b) {
  const std::size_t n = b.size();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = a[i * n + j];
      for (std::size_t k = 0; k < j; ++k) sum -= a[i * n + k] * a[j * n + k];
      a[i * n + j] = i == j ? std::sqrt(sum) : sum / a[j * n + j];
    }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < i; ++k) b[i] = b[i] - b[k] * a[i * n + k];
    b[i] = b[i] / a[i * n + i];
  }
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t k = i + 1; k < n; ++k) b[i] = b[i] - b[k] * a[k * n + i];
    b[i] = b[i] / a[i * n + i];
  }
  return b;
}

/// [view] the log gains that minimize the pairs' differences (linear least squares with a prior
/// towards gain 1). As the prior is the same for all views, the mean over overlapping views is 0.
std::vector<Vec3d> best_gains(std::size_t view_count, std::span<const Pair> pairs) {
  const std::size_t n = view_count;
  std::vector<double> a(n * n, 0);
  std::vector<Vec3d> b(n);
  for (std::size_t v = 0; v < n; ++v) a[v * n + v] = 1 / (kPriorError * kPriorError);
  for (const Pair& p : pairs) {
    a[p.first * n + p.first] += p.weight, a[p.second * n + p.second] += p.weight;
    a[p.first * n + p.second] -= p.weight, a[p.second * n + p.first] -= p.weight;
    b[p.first] = b[p.first] - p.log_ratio * p.weight;
    b[p.second] += p.log_ratio * p.weight;
  }
  std::vector<Vec3d> gains = solve(std::move(a), std::move(b));
  const double most = std::log(kMostGain);
  for (Vec3d& g : gains)
    for (int c = 0; c < 3; ++c) g[c] = std::clamp(g[c], -most, most);
  return gains;
}

using Balances = std::map<ViewId, ColorBalance::Balance>;

/// Initial log gain of a new view, so that it matches the old views, whose smoothed gains lag
/// behind: its estimate minus their lag.
Vec3d start_of(std::size_t view, std::span<const View> views, std::span<const Pair> pairs,
               const std::vector<Vec3d>& wanted, const Balances& before) {
  Vec3d ahead;
  double weight = 0;
  for (const Pair& pair : pairs) {
    if (pair.first != view && pair.second != view) continue;
    const std::size_t other = pair.first == view ? pair.second : pair.first;
    const auto known = before.find(views[other].id);
    if (known == before.end()) continue;
    for (int c = 0; c < 3; ++c)
      ahead[c] += pair.weight * (known->second[c].smoothed - wanted[other][c]);
    weight += pair.weight;
  }
  return weight > 0 ? wanted[view] + ahead / weight : wanted[view];
}

/// Accumulates the colour differences of two views along edges.
class EdgeSteps {
 public:
  explicit EdgeSteps(int most_contrast) : most_contrast_(most_contrast) {}

  void add(const PicturedView& a, const GainTables& tables_a, const PicturedView& b,
           const GainTables& tables_b, Vec3f from, Vec3f to) {
    const double edge_m = length(to - from);
    const int count = std::max(1, static_cast<int>(std::ceil(std::min(edge_m / kSeamStep_m, 1e4))));
    for (int i = 0; i < count; ++i) {
      const Vec3f p =
          from + (to - from) * ((static_cast<float>(i) + 0.5f) / static_cast<float>(count));
      const auto pixel_a = a.pixel(p), pixel_b = b.pixel(p);
      if (!pixel_a || !pixel_b) continue;
      if (std::max(a.contrast(*pixel_a), b.contrast(*pixel_b)) > most_contrast_) continue;
      const auto color_a = a.color(*pixel_a), color_b = b.color(*pixel_b);
      int most = 0;
      for (int c = 0; c < 3; ++c)
        most = std::max(most, std::abs(tables_a[c][color_a[c]] - tables_b[c][color_b[c]]));
      sum_ += most * edge_m / count, length_m_ += edge_m / count;
    }
  }
  double mean() const { return length_m_ > 0 ? sum_ / length_m_ : 0; }

 private:
  int most_contrast_;
  double sum_ = 0, length_m_ = 0;
};

}  // namespace

GainTables gain_tables(Vec3f gain) {
  GainTables out;
  for (int c = 0; c < 3; ++c)
    for (int i = 0; i < 256; ++i) {
      const double srgb = to_srgb(std::min(1.0, to_linear(i / 255.0) * gain[c]));
      out[c][i] = static_cast<std::uint8_t>(std::clamp(srgb * 255 + 0.5, 0.0, 255.0));
    }
  return out;
}

void ColorBalance::Channel::start(double wanted) {
  wanted = std::clamp(wanted, -std::log(kMostGain), std::log(kMostGain));
  smoothed = wanted;
  used = std::abs(wanted) > kDeadBand ? wanted : 0;
}

void ColorBalance::Channel::follow(double wanted) {
  smoothed += kShare * (wanted - smoothed);
  if (std::abs(smoothed - used) > kDeadBand) moving = true;
  if (!moving) return;
  used = smoothed;
  moving = std::abs(wanted - smoothed) > kArrived;
}

void ColorBalance::update(const Mesh& mesh, std::span<const View> views, const Pictures& pictures) {
  const std::size_t sample_count = std::min(kSamplesPerView * views.size(), kMostSamples);
  const std::vector<Pair> pairs =
      find_pairs(observe(spread_samples(mesh, sample_count), mesh, views, pictures));
  const std::vector<Vec3d> wanted = best_gains(views.size(), pairs);
  std::vector<std::uint8_t> overlaps(views.size(), 0);
  for (const Pair& pair : pairs) overlaps[pair.first] = overlaps[pair.second] = 1;

  Balances now;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const auto before = balances_.find(views[v].id);
    if (before == balances_.end() && !pictures.contains(views[v].stream)) continue;
    Balance& balance = now[views[v].id];
    if (before != balances_.end()) balance = before->second;
    if (!overlaps[v]) continue;
    const Vec3d start = start_of(v, views, pairs, wanted, balances_);
    for (int c = 0; c < 3; ++c)
      before == balances_.end() ? balance[c].start(start[c]) : balance[c].follow(wanted[v][c]);
  }
  balances_ = std::move(now);

  gains_.clear();
  for (const View& view : views) gains_[view.id] = {1, 1, 1};
  for (const auto& [id, balance] : balances_)
    for (int c = 0; c < 3; ++c) gains_[id][c] = static_cast<float>(std::exp(balance[c].used));
}

double seam_color_step(const Mesh& mesh, std::span<const View> views, const Pictures& pictures,
                       const Gains& gains, int most_contrast) {
  std::map<ViewId, std::pair<PicturedView, GainTables>> shown;
  for (const View& view : views) {
    const auto gain = gains.find(view.id);
    if (const auto found = PicturedView::find(view, pictures))
      shown.try_emplace(view.id, *found,
                        gain_tables(gain == gains.end() ? Vec3f{1, 1, 1} : gain->second));
  }
  const std::vector<ViewId> ids = triangle_views(mesh);
  const std::vector<std::uint32_t> twin = kit::edge_table(mesh).twin;
  EdgeSteps steps(most_contrast);
  for (std::uint32_t h = 0; h < twin.size(); ++h) {
    if (twin[h] == kit::kNoTwin || twin[h] < h || ids[h / 3] == ids[twin[h] / 3]) continue;
    const auto a = shown.find(ids[h / 3]), b = shown.find(ids[twin[h] / 3]);
    if (a == shown.end() || b == shown.end()) continue;
    steps.add(a->second.first, a->second.second, b->second.first, b->second.second,
              mesh.positions[kit::edge_from(mesh, h)], mesh.positions[kit::edge_to(mesh, h)]);
  }
  return steps.mean();
}

}  // namespace mr::atlas
