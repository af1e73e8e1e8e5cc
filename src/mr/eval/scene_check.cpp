#include "mr/eval/scene_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>
#include <utility>

#include "mr/baseline/monolithic.h"
#include "mr/calib/outliers.h"
#include "mr/calib/residuals.h"
#include "mr/kit/part.h"
#include "mr/node/sources.h"
#include "mr/sensor/registration.h"

namespace mr::eval {
namespace {

constexpr double kLeastVoxel_m = 0.02;  // a finer one takes longer without a better result
constexpr double kLeastShare = 0.85;    // of what both should see, as calib::outliers has it
constexpr double kAnyDepth_m = 1e6;
constexpr double kMostOutside = 0.5;  // of the pixels with depth; more is reported

/// Recorded sensors with all depth that they hold; rigs render what is in range.
Scene without_ranges(Scene scene) {
  if (!scene.rig)
    for (SensorConfig& sensor : scene.sensors)
      sensor.depth_near_m = 0, sensor.depth_far_m = kAnyDepth_m;
  return scene;
}

std::string range_text(const SensorConfig& sensor) {
  return fmt::format("depth_range_m [{:g}, {:g}]", sensor.depth_near_m, sensor.depth_far_m);
}

std::vector<std::string> hints_of(const SensorConfig& sensor, const SensorCheck& check,
                                  std::size_t with_depth, double median_m) {
  if (with_depth == 0)
    return {"no pixel has depth: is it the right picture, and is 'invalid' right?"};
  std::vector<std::string> hints;
  if (auto hint = sensor.source.depth_hint(median_m)) hints.push_back(*std::move(hint));
  if (check.outside_ratio > kMostOutside)
    hints.push_back(fmt::format("{:.0f} % of the pixels with depth lie outside {}",
                                100 * check.outside_ratio, range_text(sensor)));
  return hints;
}

/// Sorts.
double median_of(std::vector<float>& values) {
  std::ranges::sort(values);
  return values.empty() ? 0 : static_cast<double>(values[values.size() / 2]);
}

/// Fills in what the pictures hold, and drops the depth that is out of range.
void look_at_pictures(const SensorConfig& sensor, Frame& frame, SensorCheck& check) {
  check.depth_width = frame.depth.width, check.depth_height = frame.depth.height;
  check.color_width = frame.color.width, check.color_height = frame.color.height;
  std::vector<float> all, valid;
  for (float& depth : frame.depth.data) {
    if (!(depth > 0)) continue;
    all.push_back(depth);
    const bool in_range = static_cast<double>(depth) >= sensor.depth_near_m &&
                          static_cast<double>(depth) <= sensor.depth_far_m;
    if (in_range)
      valid.push_back(depth);
    else
      depth = 0;
  }
  const double median_m = median_of(all), valid_median_m = median_of(valid);
  const std::vector<float>& reported = valid.empty() ? all : valid;
  if (!reported.empty()) {
    check.min_m = static_cast<double>(reported.front()),
    check.max_m = static_cast<double>(reported.back());
    check.median_m = valid.empty() ? median_m : valid_median_m;
    check.outside_ratio = 1 - static_cast<double>(valid.size()) / static_cast<double>(all.size());
  }
  check.valid_ratio =
      static_cast<double>(valid.size()) / static_cast<double>(frame.depth.data.size());
  check.hints = hints_of(sensor, check, all.size(), median_m);
}

/// The sensor's own surface, as a merger would get it.
kit::Part surface_of(const Scene& scene, SensorId sensor, Frame frame, double voxel_m) {
  const sensor::Registration registration(scene.sensor(sensor), sensor);
  frame = registration.undistort(std::move(frame));
  kit::Part part;
  part.mesh = baseline::fuse_all(scene, std::span(&frame, 1), voxel_m);
  part.sources.push_back({sensor, frame.captured_at(), registration.depth_camera(),
                          frame.T_world_depth, scene.sensor(sensor).precision});
  return part;
}

Fit fit_of(const PairFit& pair) {
  if (pair.shared_m2 < kLeastShare * pair.expected_m2) return Fit::bad;
  if (pair.residual_mm <= pair.noise_mm) return Fit::good;
  return pair.residual_mm <= 2 * pair.noise_mm ? Fit::usable : Fit::bad;
}

double noise_mm(const Scene& scene, const SensorConfig& a, double depth_a_m, const SensorConfig& b,
                double depth_b_m) {
  const double sigma_m = std::hypot(scene.merge.calibration_error_m, a.precision.sigma_m(depth_a_m),
                                    b.precision.sigma_m(depth_b_m));
  return 1000 * std::max(scene.voxel_m / 2, sigma_m);
}

/// Worst first: by how much is amiss, then by distance against what is to be expected.
bool is_worse(const PairFit& x, const PairFit& y) {
  const auto key = [](const PairFit& p) {
    return std::tuple(p.fit, p.residual_mm / p.noise_mm + 1 - p.shared_m2 / p.expected_m2);
  };
  return key(x) > key(y);
}

/// Rates the fit of the sensors that have a surface.
void compare(const Scene& scene, std::span<const kit::Part> parts, double voxel_m,
             SceneCheck& check) {
  const auto sensor_of = [&](std::uint32_t part) { return parts[part].sources.front().sensor; };
  const auto check_of = [&](std::uint32_t part) -> SensorCheck& {
    return check.sensors[index_of(sensor_of(part))];
  };
  const auto residuals = calib::pair_residuals(parts, {.voxel_m = voxel_m});
  std::vector<bool> alone(parts.size(), true);
  double limit_mm = 0;
  for (const calib::PairResidual& r : residuals) {
    const SensorCheck &a = check_of(r.a), &b = check_of(r.b);
    PairFit pair{a.id, b.id, r.untrimmed_mm, 0, r.shared_m2, r.expected_m2, Fit::good};
    pair.noise_mm = noise_mm(scene, scene.sensor(sensor_of(r.a)), a.median_m,
                             scene.sensor(sensor_of(r.b)), b.median_m);
    pair.fit = fit_of(pair);
    limit_mm = std::max(limit_mm, 2 * pair.noise_mm);
    alone[r.a] = alone[r.b] = false;
    check.pairs.push_back(std::move(pair));
  }
  std::ranges::stable_sort(check.pairs, is_worse);
  for (const std::uint32_t i : calib::outliers(residuals, parts.size(), limit_mm))
    check.misfits.push_back(check_of(i).id);
  for (std::uint32_t i = 0; i < parts.size() && parts.size() > 1; ++i)
    if (alone[i])
      check_of(i).hints.push_back(
          "sees no surface that another sensor sees: check T_world_depth (camera to world, "
          "metres)");
}

/// The first readable frame. Missing files were reported when the scene was loaded.
Result<std::optional<Frame>> first_frame(const SensorConfig& sensor, FrameSource& source) {
  const std::size_t items = sensor.source.content().items;
  auto frame = source.next();
  for (std::size_t item = 0; !frame && item + 1 < items; ++item) {
    if (!is_gap(frame.error()) && frame.error().cause != Error::Cause::not_found &&
        !sensor.lost_poses.contains(item))
      break;
    frame = source.next();
  }
  return frame;
}

}  // namespace

const char* to_string(Fit fit) {
  constexpr const char* kNames[] = {"good", "usable", "bad"};
  return kNames[static_cast<int>(fit)];
}

std::optional<Fit> SceneCheck::fit() const {
  return pairs.empty() ? std::nullopt : std::optional(pairs.front().fit);
}

SceneCheck check_scene(const Scene& scene, const std::filesystem::path& rig_cache) {
  const Scene wide = without_ranges(scene);
  const double voxel_m = std::max(scene.voxel_m, kLeastVoxel_m);
  const std::vector<SensorId> wanted = all_sensors(scene.sensors);
  const auto sources = node::open_sources(wide, wanted, rig_cache);
  SceneCheck check;
  std::vector<kit::Part> parts;
  for (const SensorId id : wanted) {
    const SensorConfig& sensor = scene.sensor(id);
    SensorCheck& of = check.sensors.emplace_back();
    of.id = sensor.id;
    auto frame = first_frame(sensor, *sources[index_of(id)]);
    if (!frame || !*frame) {
      of.problem = frame ? "it has no pictures" : frame.error().message;
      continue;
    }
    look_at_pictures(sensor, **frame, of);
    auto part = surface_of(scene, id, **std::move(frame), voxel_m);
    if (!part.mesh.empty()) parts.push_back(std::move(part));
  }
  compare(scene, parts, voxel_m, check);
  return check;
}

}  // namespace mr::eval
