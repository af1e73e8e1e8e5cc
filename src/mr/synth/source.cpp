#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/kit/raycast.h"
#include "mr/synth/hash.h"
#include "mr/synth/room.h"

namespace mr::synth {
namespace {

constexpr std::uint32_t kNothing = 0xFFFFFFFFu;
constexpr std::size_t kRowsAtOnce = 8;
constexpr float kFarAway_m = 100;

/// A camera in the world, for the rays of its pixels.
struct Eye {
  Camera camera;
  Pose T_world_camera;

  Vec3f origin() const { return vec_cast<float>(T_world_camera.translation); }
  /// Its z in the camera's frame is 1, so distances along it are depths.
  Vec3f ray(double x, double y) const {
    return vec_cast<float>(T_world_camera.rotation * unproject(camera, {x, y}));
  }
};

void for_rows(int height, const std::function<void(int)>& body) {
  parallel_for(height, kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) body(static_cast<int>(y));
  });
}

// --- colour

/// Linear light → 8-bit sRGB with a soft shoulder, by table.
class ToneCurve {
 public:
  ToneCurve() {
    for (int i = 0; i < kSteps; ++i) {
      const double light = kExposure * kBrightest * i / (kSteps - 1);
      const double v = light * (1 + light / 16) / (1 + light * 0.55);
      const double srgb = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
      table_[i] = static_cast<std::uint8_t>(std::clamp(srgb, 0.0, 1.0) * 255 + 0.5);
    }
  }
  std::uint8_t operator()(float light) const {
    const float at = std::clamp(light * ((kSteps - 1) / kBrightest), 0.0f, kSteps - 1.0f);
    return table_[static_cast<int>(at + 0.5f)];
  }

 private:
  static constexpr int kSteps = 8192;
  static constexpr float kBrightest = 4;
  static constexpr double kExposure = 1.5;
  std::array<std::uint8_t, kSteps> table_{};
};

/// A point on a triangle: place on its surface and the light there.
struct Touch {
  Vec2f surface_m;
  Vec3f light;
};

class Painter {
 public:
  Painter(const Room& room, const Eye& eye)
      : room_(room),
        eye_(eye),
        origin_(eye.origin()),
        contrast_(static_cast<float>(2 * room.detail)) {}

  ImageRgb paint_all() const {
    const int width = eye_.camera.width, height = eye_.camera.height;
    ImageId triangles(width, height, kNothing);
    for_rows(height, [&](int y) {
      for (int x = 0; x < width; ++x) *triangles.at(x, y) = triangle_at(eye_.ray(x, y));
    });
    ImageRgb picture(width, height);
    for_rows(height, [&](int y) {
      for (int x = 0; x < width; ++x) {
        const Vec3f light = pixel(triangles, x, y);
        std::uint8_t* to = picture.at(x, y);
        for (int c = 0; c < 3; ++c) to[c] = tone_(light[c]);
      }
    });
    return picture;
  }

 private:
  std::uint32_t triangle_at(Vec3f ray) const {
    const auto hit = room_.rays->first_hit(origin_, ray, 0, kFarAway_m);
    return hit ? hit->triangle : kNothing;
  }

  bool is_edge(const ImageId& triangles, int x, int y) const {
    const auto surface = [&](int i, int j) {
      const std::uint32_t t = *triangles.at(std::clamp(i, 0, triangles.width - 1),
                                            std::clamp(j, 0, triangles.height - 1));
      return t == kNothing ? kNothing : room_.surface[t];
    };
    const std::uint32_t here = surface(x, y);
    return surface(x - 1, y) != here || surface(x + 1, y) != here || surface(x, y - 1) != here ||
           surface(x, y + 1) != here;
  }

  /// Mean of 2x2 samples. Inside a surface they lie on the plane of the middle's triangle; at its
  /// edges each has a ray of its own.
  Vec3f pixel(const ImageId& triangles, int x, int y) const {
    const std::uint32_t middle = *triangles.at(x, y);
    const bool edge = is_edge(triangles, x, y);
    if (!edge && middle == kNothing) return {};
    float grain = 0;
    if (!edge) grain = grain_on(middle, touch(middle, eye_.ray(x, y)).surface_m);
    Vec3f sum;
    for (const double dy : {-0.25, 0.25})
      for (const double dx : {-0.25, 0.25}) {
        const Vec3f ray = eye_.ray(x + dx, y + dy);
        const std::uint32_t t = edge ? triangle_at(ray) : middle;
        if (t == kNothing) continue;
        const Touch at = touch(t, ray);
        sum += shade(t, at, edge ? grain_on(t, at.surface_m) : grain);
      }
    return sum * 0.25f;
  }

  /// Where a ray meets the plane of a triangle.
  Touch touch(std::uint32_t t, Vec3f ray) const {
    const Triangle& corners = room_.mesh.triangles[t];
    const Vec3f a = room_.mesh.positions[corners[0]];
    const Vec3f ab = room_.mesh.positions[corners[1]] - a,
                ac = room_.mesh.positions[corners[2]] - a;
    const Vec3f n = cross(ab, ac);
    const float facing = dot(n, ray);
    const float depth = facing != 0 ? dot(n, a - origin_) / facing : 0;
    const Vec3f p = origin_ + ray * depth - a;
    const float nn = dot(n, n), wb = dot(cross(p, ac), n) / nn, wc = dot(cross(ab, p), n) / nn;
    const auto mixed = [&](const auto& values) {
      return values[corners[0]] * (1 - wb - wc) + values[corners[1]] * wb + values[corners[2]] * wc;
    };
    return {mixed(room_.surface_m), mixed(room_.light)};
  }

  float grain_on(std::uint32_t t, Vec2f surface_m) const {
    const Material& m = room_.materials[room_.material[t]];
    return m.grain > 0 ? contrast_ * grain_at(m, surface_m) : 0;
  }

  Vec3f shade(std::uint32_t t, const Touch& at, float grain) const {
    const Material& m = room_.materials[room_.material[t]];
    const Vec3f color = paint(m, at.surface_m, grain);
    if (m.emission > 0) return color * m.emission;
    const Vec3f light = max(at.light, Vec3f{});
    return {color.x * light.x, color.y * light.y, color.z * light.z};
  }

  const Room& room_;
  const Eye& eye_;
  const Vec3f origin_;
  const float contrast_;
  const ToneCurve tone_;
};

// --- depth

constexpr float kGrazingSine = 0.1392f;  // 8 degrees
constexpr float kEdge_m = 0.05f;         // neighbours further apart than this make a depth edge

/// What the sensor would measure without noise.
struct TrueDepth {
  ImageDepth z;               ///< metres, 0 where nothing is met
  std::vector<bool> grazing;  ///< [H*W] the surface is seen at under 8 degrees
};

TrueDepth true_depth(const Room& room, const Eye& eye) {
  TrueDepth out;
  out.z = ImageDepth(eye.camera.width, eye.camera.height);
  std::vector<std::uint8_t> grazing(out.z.data.size());
  const Vec3f origin = eye.origin();
  for_rows(out.z.height, [&](int y) {
    for (int x = 0; x < out.z.width; ++x) {
      const Vec3f ray = eye.ray(x, y);
      const auto hit = room.rays->first_hit(origin, ray, 0, kFarAway_m);
      if (!hit) continue;
      *out.z.at(x, y) = hit->distance;
      const Vec3f normal = normalized(room.mesh.area_normal(hit->triangle));
      grazing[static_cast<std::size_t>(y) * out.z.width + x] =
          std::abs(dot(normal, normalized(ray))) < kGrazingSine;
    }
  });
  out.grazing.assign(grazing.begin(), grazing.end());
  return out;
}

/// Normal deviate: twelve 16-bit uniforms summed, exact on every platform; within ±6.
double gaussian(std::uint64_t hash) {
  std::int64_t sum = 0;
  for (int i = 0; i < 3; ++i, hash = mix(hash))
    for (int part = 0; part < 4; ++part)
      sum += static_cast<std::int64_t>(hash >> (16 * part) & 0xFFFF);
  return static_cast<double>(sum - 12 * 32767 - 6) / 65536.0;
}

/// The neighbour's depth that differs most from the pixel's.
float farthest_neighbour(const ImageDepth& z, int x, int y) {
  const float here = *z.at(x, y);
  float best = here;
  for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
    if (!z.contains(x + dx, y + dy)) continue;
    const float there = *z.at(x + dx, y + dy);
    if (there > 0 && std::abs(there - here) > std::abs(best - here)) best = there;
  }
  return best;
}

class SyntheticSourceReader final : public FrameSource {
 public:
  SyntheticSourceReader(std::shared_ptr<const Room> room, const RigConfig& rig,
                        const SensorConfig& sensor, std::uint32_t sensor_index, double fps)
      : room_(std::move(room)),
        rig_(rig),
        sensor_(sensor),
        sensor_index_(sensor_index),
        fps_(fps) {}

  Result<std::optional<Frame>> next() override {
    if (index_ >= static_cast<std::uint64_t>(std::max(rig_.frames, 0)))
      return std::optional<Frame>{};
    if (index_ == 0) render();
    Frame frame;
    frame.sensor = sensor_index_;
    frame.index = index_++;
    const double ns = static_cast<double>(frame.index) * 1e9 / fps_ + sensor_.clock_offset_ms * 1e6;
    frame.exposure_start = frame.exposure_end = TimePoint(Duration(std::llround(ns)));
    frame.T_world_depth = sensor_.T_world_depth.at(0);
    frame.color = color_;
    frame.depth = measure(frame.index);
    return std::optional<Frame>(std::move(frame));
  }

 private:
  /// The room stands still, so one look is enough.
  void render() {
    const Pose T_world_depth = sensor_.T_world_depth.at(0);
    truth_ = true_depth(*room_, {sensor_.depth_camera, T_world_depth});
    if (!sensor_.color_camera) return;
    const Eye eye{*sensor_.color_camera, T_world_depth * sensor_.T_color_depth.inverse()};
    color_ = Painter(*room_, eye).paint_all();
  }

  ImageDepth measure(std::uint64_t index) const {
    ImageDepth depth(truth_.z.width, truth_.z.height);
    const auto camera = std::get<SyntheticSource>(sensor_.source).camera;
    const std::uint64_t frame_seed = mix(mix(rig_.seed, camera), index);
    for_rows(depth.height, [&](int y) {
      for (int x = 0; x < depth.width; ++x) {
        const double z = rig_.noise ? noisy(x, y, frame_seed) : *truth_.z.at(x, y);
        if (z >= sensor_.depth_near_m && z <= sensor_.depth_far_m)
          *depth.at(x, y) = static_cast<float>(z);
      }
    });
    return depth;
  }

  /// A Kinect's measurement of a pixel: whole millimetres, 0 where it fails.
  double noisy(int x, int y, std::uint64_t frame_seed) const {
    const std::size_t pixel = static_cast<std::size_t>(y) * truth_.z.width + x;
    double z = truth_.z.data[pixel];
    if (z <= 0 || z > sensor_.depth_far_m || truth_.grazing[pixel]) return 0;
    const std::uint64_t hash = mix(frame_seed, pixel);
    const float beyond = farthest_neighbour(truth_.z, x, y);
    if (std::abs(beyond - z) > kEdge_m && (hash & 1) != 0)  // sees both: a flying pixel
      z += (beyond - z) * (0.15 + 0.7 * unit(mix(hash, 2)));
    z += sensor_.precision.sigma_m(z) * gaussian(mix(hash, 3));
    return static_cast<double>(std::lround(z * 1000)) * 0.001;
  }

  const std::shared_ptr<const Room> room_;
  const RigConfig rig_;
  const SensorConfig sensor_;
  const std::uint32_t sensor_index_;
  const double fps_;
  std::uint64_t index_ = 0;  ///< of the next frame
  TrueDepth truth_;
  ImageRgb color_;
};

}  // namespace

std::unique_ptr<FrameSource> open_synthetic(std::shared_ptr<const Room> room, const RigConfig& rig,
                                            const SensorConfig& sensor, std::uint32_t sensor_index,
                                            double fps) {
  MR_ASSERT(room != nullptr && room->rays != nullptr);
  MR_ASSERT(std::holds_alternative<SyntheticSource>(sensor.source));
  MR_ASSERT(!sensor.T_world_depth.empty() && fps > 0);
  return std::make_unique<SyntheticSourceReader>(std::move(room), rig, sensor, sensor_index, fps);
}

}  // namespace mr::synth
