#pragma once

#include <map>

#include "mr/core/ids.h"

namespace mr::rate {

/// Splits the moving surface among sensors by what each adds to the picture: a sensor of whose
/// surface little is shown, as others see the same better, is decimated more. Counts captures; no
/// clock.
class SensorShares {
 public:
  struct Triangles {
    double delivered = 0;  ///< by a sensor
    double shown = 0;      ///< textured by it, in what is shown
  };

  /// What came of a capture, by sensor.
  void note(const std::map<SensorId, Triangles>& capture);
  /// By how much a sensor's error limit is above that of the others: 1, or one of kSteps.
  double coarser(SensorId sensor) const;

 private:
  static constexpr double kSteps[] = {1, 1.4, 2};
  struct Sensor {
    Triangles mean;
    int step = 0;
  };
  void decide();

  std::map<SensorId, Sensor> sensors_;
  int captures_ = 0;
};

}  // namespace mr::rate
