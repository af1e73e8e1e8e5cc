#include "mr/atlas/color_balance.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace mr::atlas {
namespace {

constexpr std::size_t kSamplesPerView = 1024, kMostSamples = 32768;
constexpr float kSimilarFacing = 0.2f;
constexpr float kEven = 0.2f;        // contrast around a point from which on it counts less
constexpr float kDeadBand = 0.015f;  // of the logarithms of light
constexpr float kStep = 0.01f;

/// Each two views that see a sample.
std::vector<LightPair> pairs_of(const std::vector<std::vector<Observation>>& observations) {
  std::vector<LightPair> out;
  for (const std::vector<Observation>& seen : observations)
    for (std::size_t i = 0; i < seen.size(); ++i)
      for (std::size_t j = i + 1; j < seen.size(); ++j) {
        const Observation &a = seen[i], &b = seen[j];
        const float unlike = (a.facing - b.facing) / kSimilarFacing;
        const float uneven = std::max(a.contrast, b.contrast) / kEven;
        const float weight = a.facing * b.facing * std::min(a.level, b.level) /
                             ((1 + unlike * unlike) * (1 + uneven * uneven));
        out.push_back({a.view, b.view, a.place, b.place, a.log_light - b.log_light, weight,
                       0.5f * (a.slope + b.slope)});
      }
  return out;
}

float largest(const ColorField& field) {
  float most = 0;
  for (const Vec3f& g : field.log_gain)
    most = std::max({most, std::abs(g.x), std::abs(g.y), std::abs(g.z)});
  return most;
}

/// The largest difference of two fields.
float difference(const ColorField& a, const ColorField& b) {
  if (a.empty()) return largest(b);
  if (b.empty()) return largest(a);
  float most = 0;
  for (std::size_t i = 0; i < a.log_gain.size(); ++i)
    for (int c = 0; c < 3; ++c)
      most = std::max(most, std::abs(a.log_gain[i][c] - b.log_gain[i][c]));
  return most;
}

/// `share` of the way from one field to another.
ColorField between(const ColorField& from, const ColorField& to, float share) {
  if (share >= 1) return to;
  ColorField out{std::vector<Vec3f>(ColorField::kNodes)};
  for (int i = 0; i < ColorField::kNodes; ++i) {
    const Vec3f a = from.empty() ? Vec3f{} : from.log_gain[i];
    const Vec3f b = to.empty() ? Vec3f{} : to.log_gain[i];
    out.log_gain[i] = a + (b - a) * share;
  }
  return out;
}

Vec3f factor(Vec3f log_gain) {
  return {std::exp(log_gain.x), std::exp(log_gain.y), std::exp(log_gain.z)};
}

}  // namespace

void ColorBalance::estimate(const Capture& capture, float share) {
  const std::size_t samples = std::min(kSamplesPerView * capture.views.size(), kMostSamples);
  const std::vector<LightPair> pairs =
      pairs_of(observe(spread_samples(capture.mesh, samples), capture.mesh, capture.views,
                       capture.pictures, capture.valid));
  std::vector<float> aspects;
  for (const View& view : capture.views)
    aspects.push_back(static_cast<float>(view.height) / static_cast<float>(view.width));
  const ColorFit fit_of_all = fit_colors(aspects, pairs);
  misplaced_px_ = fit_of_all.misplaced_px;

  std::map<ViewId, ColorField> wanted, fields;
  findings_.clear();
  for (std::size_t v = 0; v < capture.views.size(); ++v) {
    const ViewId id = capture.views[v].id;
    const ViewFit& fit = fit_of_all.views[v];
    findings_[id] = {fit.overlaps, factor(fit.field.mean()), fit.misfit};
    const auto known = wanted_.find(id);
    if (known == wanted_.end())
      wanted[id] = fit.field;
    else
      wanted[id] = fit.overlaps ? between(known->second, fit.field, share) : known->second;
    if (known != wanted_.end())
      fields[id] = fields_[id];
    else if (largest(fit.field) > kDeadBand)
      fields[id] = fit.field;
    else
      fields[id] = {};
  }
  wanted_ = std::move(wanted), fields_ = std::move(fields);
}

void ColorBalance::follow(bool at_once) {
  float most = 0;
  for (const auto& [id, field] : wanted_) most = std::max(most, difference(field, fields_[id]));
  if (most > kDeadBand) is_moving_ = true;
  if (!is_moving_) return;
  const float share = at_once || most <= kStep ? 1 : kStep / most;
  for (const auto& [id, field] : wanted_) {
    ColorField& shown = fields_[id];
    shown = between(shown, field, share);
    if (share >= 1 && largest(shown) <= kDeadBand) shown = {};
  }
  is_moving_ = share < 1;
}

}  // namespace mr::atlas
