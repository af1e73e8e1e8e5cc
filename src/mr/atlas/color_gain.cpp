#include "mr/atlas/color_gain.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/parallel.h"
#include "mr/core/pose.h"
#include "mr/kit/raster.h"
#include "mr/kit/topology.h"

namespace mr::atlas {
namespace {

constexpr std::size_t kSamplesPerView = 1024, kMostSamples = 32768;
constexpr int kCoarse_px = 128;  // longer side of the pictures that tell what is in sight
constexpr float kSightMargin_m = 0.03f;
constexpr float kSightMargin_px = 3;  // coarse pixels: a slope of 60 degrees hides nothing
constexpr float kLeastGainFacing =
    0.5f;  // sine: flatter than 30 degrees to the surface, gloss misleads
constexpr float kSimilarFacing = 0.2f;
constexpr int kDarkest = 8, kBrightest = 247;           // beyond, a channel may be clipped
constexpr double kFewSamples = 4, kEnoughSamples = 20;  // a pair counts in full from here
constexpr double kPairError = 0.02;  // of a pair's log ratio, however many samples it has
constexpr double kPriorError = 0.5;  // of the guess that a view needs no gain
constexpr double kMostGain = 3;
constexpr double kShare = 1.0 / 30;  // of the way to the estimate that a frame goes
constexpr double kDeadBand = 0.006;  // of the log gain: half a step of bright sRGB
constexpr double kArrived = 0.001;
constexpr double kSeamStep_m = 0.01;

double to_linear(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
}
double to_srgb(double linear) {
  return linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

/// Linear light of an sRGB byte.
float light_of(std::uint8_t srgb) {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> out;
    for (int i = 0; i < 256; ++i) out[i] = static_cast<float>(to_linear(i / 255.0));
    return out;
  }();
  return table[srgb];
}

/// What is nearest along each pixel of a coarse pinhole picture.
class CoarseDepth {
 public:
  CoarseDepth(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera)
      : camera_(camera),
        T_camera_world_(T_world_camera.inverse()),
        inv_depth_(camera.width, camera.height) {
    for (int row = 0; row < 3; ++row)
      rotation_[row] = vec_cast<float>(T_camera_world_.rotation.row(row));
    translation_ = vec_cast<float>(T_camera_world_.translation);
    std::vector<std::uint32_t> next(mesh.positions.size());
    for (std::size_t v = 0; v < next.size(); ++v) next[v] = next_pixel(mesh.positions[v]);
    for (const Triangle& t : mesh.triangles) {
      // Most triangles lie between the centres of coarse pixels, or outside.
      const std::uint32_t differ = (next[t[0]] ^ next[t[1]]) | (next[t[0]] ^ next[t[2]]);
      if (!(differ & 0xFFFF) || !(differ >> 16)) continue;
      const auto corner = [&](int i) {
        return T_camera_world_ * vec_cast<double>(mesh.positions[t[i]]);
      };
      draw(kit::clip_to_screen(camera_, {corner(0), corner(1), corner(2)}));
    }
  }

  /// Whether a point is in sight, away from edges of depth; nothing within `ring_px` of the
  /// picture's border and outside.
  std::optional<bool> sees(Vec3f p_world, int ring_px) const {
    const OnScreen s = on_screen(p_world);
    const auto w = static_cast<float>(camera_.width), h = static_cast<float>(camera_.height);
    const float ring = static_cast<float>(ring_px) - 0.5f;
    if (!(s.z > 0 && s.u > ring && s.v > ring && s.u < w - 1 - ring && s.v < h - 1 - ring))
      return std::nullopt;
    const int x = static_cast<int>(s.u + 0.5f), y = static_cast<int>(s.v + 0.5f);
    const float margin = kSightMargin_m + kSightMargin_px * s.z / static_cast<float>(camera_.fx);
    const float farthest = 1 / (s.z + margin), nearest = 1 / std::max(s.z - margin, 1e-3f);
    for (int j = y - 1; j <= y + 1; ++j)
      for (int i = x - 1; i <= x + 1; ++i) {
        const float inv_z = *inv_depth_.at(i, j);
        if (inv_z < farthest || inv_z > nearest) return false;
      }
    return true;
  }

 private:
  struct OnScreen {
    float u = 0, v = 0, z = -1;  ///< z < 0: in front of the near plane
  };

  OnScreen on_screen(Vec3f p_world) const {
    const float z = dot(rotation_[2], p_world) + translation_.z;
    if (!(z >= static_cast<float>(kit::kNearPlane_m))) return {};
    const float x = dot(rotation_[0], p_world) + translation_.x;
    const float y = dot(rotation_[1], p_world) + translation_.y;
    return {static_cast<float>(camera_.fx) * x / z + static_cast<float>(camera_.cx),
            static_cast<float>(camera_.fy) * y / z + static_cast<float>(camera_.cy), z};
  }

  /// The first column and row of pixel centres from a point on, those outside alike: where it is
  /// the same for two points, no pixel centre lies between them.
  std::uint32_t next_pixel(Vec3f p_world) const {
    const OnScreen s = on_screen(p_world);
    if (s.z < 0) return 0xFFFFFFFF;
    const auto next = [](float at, int count) {
      at = at > 0 ? std::min(at, static_cast<float>(count)) : 0;
      const auto whole = static_cast<std::uint32_t>(at);
      return whole + (static_cast<float>(whole) < at);
    };
    return next(s.u, camera_.width) << 16 | next(s.v, camera_.height);
  }

  void draw(const kit::ScreenPolygon& polygon) {
    kit::scan_polygon(polygon, camera_.width, 0, camera_.height, [&](const kit::ScreenSpan& s) {
      float* const row = inv_depth_.row(s.y);
      for (int x = s.first; x <= s.last; ++x)
        row[x] = std::max(row[x], s.inv_z + static_cast<float>(x - s.first) * s.inv_z_step);
    });
  }

  Camera camera_;
  Pose T_camera_world_;
  std::array<Vec3f, 3> rotation_;  ///< of T_camera_world_
  Vec3f translation_;
  Image<float, 1> inv_depth_;  ///< 0: nothing
};

/// The pinhole pictures that tell what a view has in sight.
class ViewDepth {
 public:
  ViewDepth(const Mesh& mesh, const View& view) {
    if (view.kind == View::Kind::pinhole) {
      faces_.emplace_back(mesh, coarse(view.camera()), view.T_world_camera);
      return;
    }
    ring_px_ = 2;
    for (const kit::CubeFace& face : kit::cube_faces(kCoarse_px / 2, ring_px_))
      faces_.emplace_back(mesh, face.camera, view.T_world_camera * Pose{face.R_camera_face, {}});
  }

  bool sees(Vec3f p_world) const {
    for (const CoarseDepth& face : faces_)
      if (const auto seen = face.sees(p_world, ring_px_)) return *seen;
    return false;
  }

 private:
  static Camera coarse(Camera camera) {
    const double scale =
        std::min(1.0, static_cast<double>(kCoarse_px) / std::max(camera.width, camera.height));
    camera.width = static_cast<int>(std::ceil(camera.width * scale));
    camera.height = static_cast<int>(std::ceil(camera.height * scale));
    camera.fx *= scale, camera.fy *= scale;
    camera.cx = (camera.cx + 0.5) * scale - 0.5, camera.cy = (camera.cy + 0.5) * scale - 0.5;
    return camera;
  }

  int ring_px_ = 1;
  std::vector<CoarseDepth> faces_;
};

/// A view with its picture.
class PicturedView {
 public:
  /// Nothing when the picture is missing or does not hold the view.
  static std::optional<PicturedView> find(const View& view, const Pictures& pictures) {
    const auto found = pictures.find(view.stream);
    if (found == pictures.end() || !found->second) return std::nullopt;
    const ImageRgb& p = *found->second;
    const Rect& r = view.atlas_rect;
    if (view.image_rect.empty() || r.empty() || r.x < 0 || r.y < 0 || r.width > p.width - r.x ||
        r.height > p.height - r.y)
      return std::nullopt;
    return PicturedView(view, p);
  }

  /// Cosine between a surface's unit normal and the direction to the camera.
  float facing(Vec3f p_world, Vec3f normal) const {
    return dot(normal, normalized(vec_cast<float>(view_->T_world_camera.translation) - p_world));
  }

  /// Where the stream's picture shows a point; nothing outside the tile.
  std::optional<Vec2d> pixel(Vec3f p_world) const {
    const auto at = project(camera_, T_camera_world_ * vec_cast<double>(p_world));
    const Rect &from = view_->image_rect, &to = view_->atlas_rect;
    if (!at || !(at->x >= from.x && at->y >= from.y && at->x <= from.x + from.width - 1 &&
                 at->y <= from.y + from.height - 1))
      return std::nullopt;
    return Vec2d{(at->x + 0.5 - from.x) * to.width / from.width + to.x - 0.5,
                 (at->y + 0.5 - from.y) * to.height / from.height + to.y - 0.5};
  }

  std::array<std::uint8_t, 3> color(Vec2d pixel) const {
    return sample_bilinear(*picture_, view_->atlas_rect, pixel.x, pixel.y);
  }

  /// How much a channel varies within two pixels.
  int contrast(Vec2d pixel) const {
    const Rect& r = view_->atlas_rect;
    const int x = static_cast<int>(std::lround(pixel.x)),
              y = static_cast<int>(std::lround(pixel.y));
    std::array<std::uint8_t, 3> low{255, 255, 255}, high{};
    for (int j = std::max(r.y, y - 2); j <= std::min(r.y + r.height - 1, y + 2); ++j)
      for (int i = std::max(r.x, x - 2); i <= std::min(r.x + r.width - 1, x + 2); ++i)
        for (int c = 0; c < 3; ++c) {
          low[c] = std::min(low[c], picture_->at(i, j)[c]);
          high[c] = std::max(high[c], picture_->at(i, j)[c]);
        }
    return std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  }

  /// Mean linear light around a pixel; nothing near the tile's border and where a channel may be
  /// clipped.
  std::optional<Vec3f> light(Vec2d pixel) const {
    const Rect& r = view_->atlas_rect;
    const int step = std::max(1, r.width / 640);
    const int x = static_cast<int>(std::lround(pixel.x)),
              y = static_cast<int>(std::lround(pixel.y));
    const int margin = step + static_cast<int>(std::ceil(view_->gutter_px));
    if (x - margin < r.x || y - margin < r.y || x + margin >= r.x + r.width ||
        y + margin >= r.y + r.height)
      return std::nullopt;
    Vec3f sum;
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) {
        const std::uint8_t* const p = picture_->at(x + i * step, y + j * step);
        if (std::min({p[0], p[1], p[2]}) < kDarkest || std::max({p[0], p[1], p[2]}) > kBrightest)
          return std::nullopt;
        sum += {light_of(p[0]), light_of(p[1]), light_of(p[2])};
      }
    return sum / 9.0f;
  }

 private:
  PicturedView(const View& view, const ImageRgb& picture)
      : view_(&view),
        camera_(view.camera()),
        T_camera_world_(view.T_world_camera.inverse()),
        picture_(&picture) {}

  const View* view_;
  Camera camera_;
  Pose T_camera_world_;
  const ImageRgb* picture_;
};

/// A point of the surface.
struct Sample {
  Vec3f p_world, normal;
};

/// Points spread evenly by area.
std::vector<Sample> spread_samples(const Mesh& mesh, std::size_t count) {
  std::vector<double> area_up_to(mesh.triangles.size());
  parallel_for(area_up_to.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const float area = length(mesh.area_normal(t));
      area_up_to[t] = std::isfinite(area) ? area : 0;
    }
  });
  std::partial_sum(area_up_to.begin(), area_up_to.end(), area_up_to.begin());
  std::vector<Sample> out;
  if (area_up_to.empty() || !(area_up_to.back() > 0)) return out;
  std::size_t t = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double wanted = (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    while (t + 1 < area_up_to.size() && area_up_to[t] < wanted * area_up_to.back()) ++t;
    // The R2 sequence, folded into the triangle.
    const double n = static_cast<double>(i + 1);
    double b = n * 0.7548776662466927, c = n * 0.5698402909980532;
    b -= std::floor(b), c -= std::floor(c);
    if (b + c > 1) b = 1 - b, c = 1 - c;
    const Vec3f a = mesh.corner(t, 0);
    const Vec3f p = a + (mesh.corner(t, 1) - a) * static_cast<float>(b) +
                    (mesh.corner(t, 2) - a) * static_cast<float>(c);
    out.push_back({p, normalized(mesh.area_normal(t))});
  }
  return out;
}

/// What a view shows of a sample.
struct Observation {
  std::size_t view = 0;
  float facing = 0;
  float level = 0;  ///< the darkest channel, about as sRGB has it, to 1
  Vec3d log_light;
};

/// [sample] the views that show it well.
std::vector<std::vector<Observation>> observe(std::span<const Sample> samples, const Mesh& mesh,
                                              std::span<const View> views,
                                              const Pictures& pictures) {
  std::vector<std::optional<PicturedView>> shown(views.size());
  std::vector<std::optional<ViewDepth>> depths(views.size());
  parallel_for(views.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      shown[v] = PicturedView::find(views[v], pictures);
      if (shown[v]) depths[v].emplace(mesh, views[v]);
    }
  });
  std::vector<std::vector<Observation>> out(samples.size());
  parallel_for(samples.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t v = 0; v < views.size(); ++v) {
        const Sample& s = samples[i];
        if (!shown[v]) continue;
        const float facing = shown[v]->facing(s.p_world, s.normal);
        if (!(facing >= kLeastGainFacing) || !depths[v]->sees(s.p_world)) continue;
        const auto pixel = shown[v]->pixel(s.p_world);
        const auto light = pixel ? shown[v]->light(*pixel) : std::nullopt;
        if (!light) continue;
        const Vec3d rgb = vec_cast<double>(*light);
        out[i].push_back({v,
                          facing,
                          std::sqrt(std::min({light->x, light->y, light->z})),
                          {std::log(rgb.x), std::log(rgb.y), std::log(rgb.z)}});
      }
  });
  return out;
}

/// By how much a point's light differs between two views.
struct Difference {
  double value = 0;  ///< of the logarithms
  double weight = 0;
};

/// The value that half of the weight lies below. Sorts.
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

/// The mean around the median, without what lies far off.
RobustEstimate robust_mean(std::vector<Difference> of) {
  const double middle = median(of);
  std::vector<Difference> off = of;
  for (Difference& d : off) d.value = std::abs(d.value - middle);
  const double spread = 1.4826 * median(off);  // the standard deviation of what is Gaussian
  double sum = 0, weight = 0;
  for (const Difference& d : of)
    if (std::abs(d.value - middle) <= 2 * spread) sum += d.weight * d.value, weight += d.weight;
  return {weight > 0 ? sum / weight : middle, spread};
}

/// Two views that show the same surface.
struct Pair {
  std::size_t first = 0, second = 0;
  std::array<std::vector<Difference>, 3> samples;  ///< first less second, by channel
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

/// Solves A x = b for three right sides at once by Cholesky's decomposition; A ([n * n], lower half
/// used) is positive definite and lost.
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

/// [view] the log gains that make all pairs agree best. As every view is held to 1 alike, their
/// mean over views that overlap is 0.
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

/// Where a view that appears starts, so that it fits at once those that were there before and are
/// still on their way: its estimate less what they lack.
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

/// Sums what two views show differently along an edge.
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
