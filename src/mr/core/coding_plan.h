#pragma once

#include <string>
#include <vector>

namespace mr {

/// How far a mesh is decimated: until so few triangles are left, or the next collapse would cost
/// more than the error, whichever comes first. An error limit alone (ratio 0) leaves walls as they
/// are when somebody enters; a ratio spreads its triangles over what there is.
struct Decimation {
  double ratio = 1;    ///< triangles kept, 0 to 1; 0: as few as the error allows
  double error_m = 0;  ///< of quadric error metrics, at most 1; 0: any

  bool does_nothing() const { return ratio >= 1; }
  friend bool operator==(const Decimation&, const Decimation&) = default;
};

/// How a node codes what it sends. Made before a frame is reconstructed or a tick merged; stages
/// take it from there, and its packet tells it.
struct CodingPlan {
  Decimation decimation;     ///< of a sensor's surface (with layers: of what moves); of the root's
  double still_error_m = 0;  ///< of decimation of a sensor's still surface
  int mesh_speed = 5;        ///< Draco: 0 smallest .. 10 fastest
  double texture_scale = 1;  ///< of a tile against its camera picture
  int texture_qp = 28;       ///< H.264 quantiser

  /// What is impossible in it, a line each.
  std::vector<std::string> problems() const;
  friend bool operator==(const CodingPlan&, const CodingPlan&) = default;
};

/// The plans of all nodes of a scene, as whoever controls it gives them to the root.
struct ScenePlan {
  CodingPlan sensors, root;

  std::vector<std::string> problems() const;
  friend bool operator==(const ScenePlan&, const ScenePlan&) = default;
};

}  // namespace mr
