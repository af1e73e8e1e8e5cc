#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "mr/core/ids.h"
#include "mr/core/range.h"

namespace mr {

/// Limits of decimation: it stops at the ratio of triangles or when the next edge collapse would
/// exceed the error, whichever comes first. With an error limit alone (ratio 0) the decimation of
/// walls does not change when a person enters; a ratio distributes a triangle budget over the whole
/// mesh.
struct Decimation {
  double ratio = 1;    ///< triangles kept, 0 to 1; 0: as few as the error allows
  double error_m = 0;  ///< quadric error limit, at most 1; 0: no limit

  bool does_nothing() const { return ratio >= 1; }
  friend bool operator==(const Decimation&, const Decimation&) = default;
};

/// The coding parameters of a node. Chosen before a frame is reconstructed or a tick is merged;
/// every stage reads them, and the node's packet carries them.
struct CodingPlan {
  Decimation decimation;     ///< of a sensor's or the root's surface; with layers: moving only
  double still_error_m = 0;  ///< error limit of decimating a sensor's still surface
  int mesh_speed = 5;        ///< Draco: 0 smallest .. 10 fastest
  double texture_scale = 1;  ///< tile pixels per camera pixel, along each axis
  int texture_qp = 28;       ///< H.264 quantiser
  // Of the root's clean plates, which are encoded seldom and shown for long:
  double plate_scale = 1;
  int plate_qp = 20;

  static constexpr Range kTextureScale{0.01, 1};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const;
  friend bool operator==(const CodingPlan&, const CodingPlan&) = default;
};

/// The plans of all nodes of a scene, as a controller sends them to the root.
struct ScenePlan {
  CodingPlan sensors, root;
  std::map<SensorId, CodingPlan> by_sensor = {};  ///< sensors whose plan differs from `sensors`

  static constexpr std::size_t kMaxSensors = 1024;  ///< in `by_sensor`
  const CodingPlan& of(SensorId sensor) const;
  std::vector<std::string> problems() const;
  friend bool operator==(const ScenePlan&, const ScenePlan&) = default;
};

}  // namespace mr
