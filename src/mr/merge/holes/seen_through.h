#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/kit/part.h"
#include "mr/kit/raycast.h"

namespace mr::merge {

/// Tells where sensors saw through: a sensor's ray passed, and met its own surface farther away.
class SeenThrough {
 public:
  /// `parts`: what was merged; must outlive this. What lies less than `margin_m` behind a place may
  /// be noise of what is there. `is_moving`: so does a sensor's still surface, where the sensor
  /// confirms it.
  SeenThrough(std::span<const kit::Part> parts, double margin_m, bool is_moving);

  /// Whether a sensor saw through a surface at `p`; only sensors that the surface faces count.
  /// Thread-safe.
  bool at(Vec3f p, Vec3f normal) const;

 private:
  struct Sensor {
    std::uint32_t part = 0;
    const SourceInfo* source = nullptr;
  };
  bool passed(const Sensor& sensor, Vec3f p, std::vector<kit::RayHit>& hits) const;

  std::span<const kit::Part> parts_;
  float margin_m_;
  bool is_moving_;
  std::vector<Sensor> sensors_;
  std::vector<std::vector<SensorId>> measured_by_;  // [parts][T]; empty: by the only source
  kit::RayScene scene_;
};

}  // namespace mr::merge
