#include "mr/atlas/color_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/kit/disjoint_sets.h"

namespace mr::atlas {
namespace {

// Unknowns of a view: its gain, two coefficients of vignetting, and the nodes of its field.
constexpr std::size_t kGain = 0, kVignetting = 1, kNodes = 3, kUnknowns = 3 + ColorField::kNodes;

// Standard deviations, of logarithms of light.
constexpr double kGainSpread = 2, kVignettingSpread = 0.2, kNodeSpread = 0.1, kStepSpread = 0.02;
constexpr double kPairSpread = 0.3;  // of one pair: texture, misplaced pictures, noise
constexpr double kMisfit = 0.12;     // a pair that differs by more counts little
constexpr double kFewPairs = 4;      // sum of weights from which on two views count as overlapping
constexpr int kReweightings = 4, kSteps = 24;
constexpr double kSolved = 1e-4;  // of the first residual

/// A weighted value.
struct Weighted {
  double value = 0, weight = 0;
};

/// Weighted median; 0 of nothing.
double median(std::vector<Weighted> of) {
  std::sort(of.begin(), of.end(), [](const Weighted& a, const Weighted& b) {
    return std::pair(a.value, a.weight) < std::pair(b.value, b.weight);
  });
  double left = 0;
  for (const Weighted& w : of) left += 0.5 * w.weight;
  for (const Weighted& w : of)
    if ((left -= w.weight) <= 0) return w.value;
  return 0;
}

/// Where a view's unknowns act on one point.
struct Place {
  std::size_t base = 0;  ///< index of the view's first unknown
  FieldWeights field;
  double r2 = 0;  ///< squared distance from the middle of the picture; 1 in its corners

  static double squared_distance(Vec2f place, float aspect) {
    const double x = 2.0 * place.x - 1, y = (2.0 * place.y - 1) * aspect;
    return (x * x + y * y) / (1 + static_cast<double>(aspect) * aspect);
  }

  double value(std::span<const double> x) const {
    double sum = x[base + kGain] + x[base + kVignetting] * r2 + x[base + kVignetting + 1] * r2 * r2;
    for (int i = 0; i < 4; ++i) sum += field.weight[i] * x[base + kNodes + field.node[i]];
    return sum;
  }
  /// Adds `amount` times the derivatives of value().
  void add(double amount, std::span<double> x) const {
    x[base + kGain] += amount;
    x[base + kVignetting] += amount * r2, x[base + kVignetting + 1] += amount * r2 * r2;
    for (int i = 0; i < 4; ++i) x[base + kNodes + field.node[i]] += amount * field.weight[i];
  }
};

/// An equation: the light of both places, corrected, is the same.
struct Equation {
  Place first, second;
  Vec3f log_ratio;
  float slope = 0;    ///< LightPair
  double trust = 0;   ///< before reweighting
  double weight = 0;  ///< 1 / variance
};

/// Conjugate gradients on the normal equations of one channel.
class Channel {
 public:
  Channel(std::size_t views, std::span<const Equation> equations, int channel)
      : views_(views), equations_(equations), channel_(channel), diagonal_(views * kUnknowns) {
    for (std::size_t v = 0; v < views; ++v)
      for (std::size_t i = 0; i < kUnknowns; ++i)
        diagonal_[v * kUnknowns + i] =
            prior(i) + (i < kNodes ? 0 : 4 / (kStepSpread * kStepSpread));
    for (const Equation& e : equations)
      for (const Place* p : {&e.first, &e.second}) {
        diagonal_[p->base + kGain] += e.weight;
        diagonal_[p->base + kVignetting] += e.weight * p->r2 * p->r2;
        diagonal_[p->base + kVignetting + 1] += e.weight * std::pow(p->r2, 4);
        for (int i = 0; i < 4; ++i)
          diagonal_[p->base + kNodes + p->field.node[i]] +=
              e.weight * p->field.weight[i] * p->field.weight[i];
      }
  }

  /// Improves a solution.
  void solve(std::vector<double>& x) const {
    const std::size_t n = x.size();
    std::vector<double> residual = right_side(), product = times(x), direction(n), scaled(n);
    for (std::size_t i = 0; i < n; ++i) residual[i] -= product[i];
    double before = 0, first = 0;
    for (int step = 0; step < kSteps; ++step) {
      double now = 0;
      for (std::size_t i = 0; i < n; ++i)
        scaled[i] = residual[i] / diagonal_[i], now += residual[i] * scaled[i];
      if (step == 0) first = now;
      if (now <= kSolved * kSolved * first || now == 0) return;
      const double keep = step == 0 ? 0 : now / before;
      for (std::size_t i = 0; i < n; ++i) direction[i] = scaled[i] + keep * direction[i];
      product = times(direction);
      double along = 0;
      for (std::size_t i = 0; i < n; ++i) along += direction[i] * product[i];
      for (std::size_t i = 0; i < n; ++i) {
        x[i] += now / along * direction[i];
        residual[i] -= now / along * product[i];
      }
      before = now;
    }
  }

 private:
  static double prior(std::size_t unknown) {
    const double spread = unknown == kGain   ? kGainSpread
                          : unknown < kNodes ? kVignettingSpread
                                             : kNodeSpread;
    return 1 / (spread * spread);
  }

  std::vector<double> right_side() const {
    std::vector<double> out(views_ * kUnknowns);
    for (const Equation& e : equations_) {
      const double amount = e.weight * e.log_ratio[channel_];
      e.first.add(-amount, out), e.second.add(amount, out);
    }
    return out;
  }

  std::vector<double> times(std::span<const double> x) const {
    std::vector<double> out(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) out[i] = prior(i % kUnknowns) * x[i];
    for (std::size_t v = 0; v < views_; ++v) add_steps(x, v * kUnknowns + kNodes, out);
    for (const Equation& e : equations_) {
      const double amount = e.weight * (e.first.value(x) - e.second.value(x));
      e.first.add(amount, out), e.second.add(-amount, out);
    }
    return out;
  }

  /// Adds the smoothness of a field whose first node is at `base`.
  static void add_steps(std::span<const double> x, std::size_t base, std::span<double> out) {
    constexpr double kWeight = 1 / (kStepSpread * kStepSpread);
    const auto add = [&](std::size_t a, std::size_t b) {
      const double amount = kWeight * (x[a] - x[b]);
      out[a] += amount, out[b] -= amount;
    };
    for (int row = 0; row < ColorField::kRows; ++row)
      for (int column = 0; column < ColorField::kColumns; ++column) {
        const std::size_t node =
            base + static_cast<std::size_t>(row * ColorField::kColumns + column);
        if (column + 1 < ColorField::kColumns) add(node, node + 1);
        if (row + 1 < ColorField::kRows) add(node, node + ColorField::kColumns);
      }
  }

  std::size_t views_;
  std::span<const Equation> equations_;
  int channel_;
  std::vector<double> diagonal_;
};

using Solution = std::array<std::vector<double>, 3>;  // by channel

/// By how much the two places of an equation differ; of all channels the most.
double difference(const Equation& e, const Solution& x) {
  double most = 0;
  for (int c = 0; c < 3; ++c)
    most = std::max(most, std::abs(e.log_ratio[c] + e.first.value(x[c]) - e.second.value(x[c])));
  return most;
}

/// ColorFit::misplaced_px.
double misplaced_px(std::span<const Equation> equations, const Solution& x) {
  constexpr float kSteep = 0.03f;
  std::vector<Weighted> all;
  for (const Equation& e : equations) {
    if (e.slope < kSteep) continue;
    const double off = e.log_ratio.y + e.first.value(x[1]) - e.second.value(x[1]);
    all.push_back({std::abs(off) / (std::sqrt(2.0) * e.slope), e.trust});  // two pictures
  }
  return median(std::move(all));
}

/// Gains alone, from the medians of each two views' ratios, along the strongest overlaps first: a
/// start from which most pairs are nearly right.
Solution first_gains(std::size_t views, std::span<const LightPair> pairs) {
  struct Overlap {
    std::array<std::vector<Weighted>, 3> ratios;
    double weight = 0;
  };
  std::map<std::pair<std::size_t, std::size_t>, Overlap> overlaps;
  for (const LightPair& p : pairs) {
    Overlap& o = overlaps[{p.first, p.second}];
    for (int c = 0; c < 3; ++c) o.ratios[c].push_back({p.log_ratio[c], p.weight});
    o.weight += p.weight;
  }
  std::vector<std::pair<std::pair<std::size_t, std::size_t>, const Overlap*>> order;
  for (const auto& [views_of, overlap] : overlaps) order.emplace_back(views_of, &overlap);
  std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) {
    return a.second->weight > b.second->weight;
  });
  Solution x;
  for (auto& channel : x) channel.resize(views * kUnknowns);
  kit::DisjointSets joined(views);
  for (const auto& [ids, overlap] : order) {
    const auto a = static_cast<std::uint32_t>(ids.first),
               b = static_cast<std::uint32_t>(ids.second);
    if (joined.of(a) == joined.of(b)) continue;
    const std::uint32_t moved = joined.of(b);
    for (int c = 0; c < 3; ++c) {
      // The group of the second view moves as a whole.
      const double shift = median(overlap->ratios[c]) + x[c][a * kUnknowns] - x[c][b * kUnknowns];
      for (std::uint32_t v = 0; v < views; ++v)
        if (joined.of(v) == moved) x[c][v * kUnknowns] += shift;
    }
    joined.join(a, b);
  }
  return x;
}

/// [view] which views overlap, directly or through others: equal numbers; alone: a number of its
/// own.
std::vector<std::uint32_t> groups_of(std::size_t views, std::span<const LightPair> pairs) {
  std::map<std::pair<std::size_t, std::size_t>, double> weight;
  for (const LightPair& p : pairs) weight[{p.first, p.second}] += p.weight;
  kit::DisjointSets sets(views);
  for (const auto& [ids, sum] : weight)
    if (sum >= kFewPairs)
      sets.join(static_cast<std::uint32_t>(ids.first), static_cast<std::uint32_t>(ids.second));
  std::vector<std::uint32_t> out(views);
  for (std::uint32_t v = 0; v < views; ++v) out[v] = sets.of(v);
  return out;
}

std::vector<Equation> equations_of(std::span<const float> aspects,
                                   std::span<const LightPair> pairs) {
  const auto place = [&](std::size_t view, Vec2f at) {
    return Place{view * kUnknowns, field_weights(at), Place::squared_distance(at, aspects[view])};
  };
  std::vector<Equation> out;
  for (const LightPair& p : pairs)
    out.push_back({place(p.first, p.place_first), place(p.second, p.place_second), p.log_ratio,
                   p.slope, p.weight / (kPairSpread * kPairSpread), 0});
  return out;
}

/// The unknowns of one view as a field.
ColorField field_of(const Solution& x, std::size_t view, float aspect) {
  ColorField out;
  for (int node = 0; node < ColorField::kNodes; ++node) {
    const Vec2f at{(static_cast<float>(node % ColorField::kColumns) + 0.5f) / ColorField::kColumns,
                   (static_cast<float>(node / ColorField::kColumns) + 0.5f) / ColorField::kRows};
    const Place place{view * kUnknowns, field_weights(at), Place::squared_distance(at, aspect)};
    Vec3f& gain = out.log_gain.emplace_back();
    for (int c = 0; c < 3; ++c) gain[c] = static_cast<float>(place.value(x[c]));
  }
  return out;
}

/// Shifts the fields of each group of views so that the middle of their mean gains is 1.
void anchor(std::span<const std::uint32_t> groups, std::vector<ViewFit>& fits) {
  for (std::uint32_t group = 0; group < groups.size(); ++group) {
    std::array<std::vector<float>, 3> means;
    for (std::size_t v = 0; v < fits.size(); ++v)
      if (groups[v] == group && fits[v].overlaps)
        for (int c = 0; c < 3; ++c) means[c].push_back(fits[v].field.mean()[c]);
    if (means[0].empty()) continue;
    Vec3f middle;
    for (int c = 0; c < 3; ++c) {
      std::sort(means[c].begin(), means[c].end());
      middle[c] = means[c][(means[c].size() - 1) / 2];
    }
    for (std::size_t v = 0; v < fits.size(); ++v)
      if (groups[v] == group)
        for (Vec3f& g : fits[v].field.log_gain) g = g - middle;
  }
}

}  // namespace

ColorFit fit_colors(std::span<const float> aspects, std::span<const LightPair> pairs) {
  const std::size_t views = aspects.size();
  const std::vector<std::uint32_t> groups = groups_of(views, pairs);
  std::vector<LightPair> used;
  for (const LightPair& p : pairs)
    if (groups[p.first] == groups[p.second]) used.push_back(p);
  Solution x = first_gains(views, used);
  std::vector<Equation> equations = equations_of(aspects, used);
  for (int round = 0; round < kReweightings; ++round) {
    for (Equation& e : equations) {
      const double off = difference(e, x) / kMisfit;
      e.weight = e.trust / ((1 + off * off) * (1 + off * off));
    }
    parallel_for(3, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t c = begin; c < end; ++c)
        Channel(views, equations, static_cast<int>(c)).solve(x[c]);
    });
  }

  ColorFit out{std::vector<ViewFit>(views), misplaced_px(equations, x)};
  std::vector<std::vector<Weighted>> misfits(views);
  for (const Equation& e : equations) {
    const Weighted misfit{difference(e, x), e.trust};
    for (const Place* p : {&e.first, &e.second}) misfits[p->base / kUnknowns].push_back(misfit);
  }
  for (std::size_t v = 0; v < views; ++v) {
    if (misfits[v].empty()) continue;
    out.views[v] = {true, field_of(x, v, aspects[v]), median(std::move(misfits[v]))};
  }
  anchor(groups, out.views);
  return out;
}

}  // namespace mr::atlas
