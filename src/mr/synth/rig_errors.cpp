#include "mr/synth/rig_errors.h"

#include <cmath>
#include <numbers>

#include "mr/synth/hash.h"

namespace mr::synth {
namespace {

/// -1 to 1, by sensor and purpose.
double drawn(const RigConfig& rig, std::uint32_t sensor, std::uint64_t purpose) {
  return 2.0 * unit(mix(mix(rig.seed, 0xE0 + purpose), sensor)) - 1;
}

Vec3d direction(const RigConfig& rig, std::uint32_t sensor, std::uint64_t purpose) {
  const double z = drawn(rig, sensor, purpose);
  const double a = std::numbers::pi * drawn(rig, sensor, purpose + 1), r = std::sqrt(1 - z * z);
  return {r * std::cos(a), r * std::sin(a), z};
}

Mat3 turn_about(Vec3d axis, double angle) {
  const double c = std::cos(angle), s = std::sin(angle), t = 1 - c;
  const auto [x, y, z] = axis;
  return {{t * x * x + c, t * x * y - s * z, t * x * z + s * y,  //
           t * x * y + s * z, t * y * y + c, t * y * z - s * x,  //
           t * x * z - s * y, t * y * z + s * x, t * z * z + c}};
}

}  // namespace

Pose calibration_error(const RigConfig& rig, std::uint32_t sensor) {
  Pose error;
  if (rig.calib_error_deg > 0)
    error.rotation =
        turn_about(direction(rig, sensor, 0), rig.calib_error_deg * std::numbers::pi / 180);
  if (rig.calib_error_mm > 0)
    error.translation = direction(rig, sensor, 2) * (rig.calib_error_mm * 0.001);
  return error;
}

Pose push_of(const RigConfig& rig, const RigEvent& event, std::uint32_t sensor) {
  const std::uint64_t purpose = 0x100 + 4 * static_cast<std::uint64_t>(event.at);
  return {turn_about(direction(rig, sensor, purpose), event.by_deg * std::numbers::pi / 180),
          direction(rig, sensor, purpose + 2) * (event.by_mm * 0.001)};
}

Vec3f exposure_gain(const RigConfig& rig, std::uint32_t sensor) {
  const double spread = rig.exposure_spread;
  const double stops = spread * drawn(rig, sensor, 4), red = 0.25 * spread * drawn(rig, sensor, 5),
               blue = 0.25 * spread * drawn(rig, sensor, 6);
  return vec_cast<float>(Vec3d{std::exp2(stops + red), std::exp2(stops), std::exp2(stops + blue)});
}

double clock_error_s(const RigConfig& rig, std::uint32_t sensor) {
  return rig.clock_offset_ms * 0.001 * drawn(rig, sensor, 7);
}

}  // namespace mr::synth
