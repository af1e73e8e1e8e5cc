#pragma once

#include <optional>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"

namespace mr::calib {

/// A part's mesh as an inverse depth map (z-buffer) of one of its sensors, into which points of
/// other parts are projected.
struct DepthView {
  Camera camera;
  Pose T_camera_world;
  int window_px = 1;
  ImageDepth inverse_depth;  ///< 1 / m, 0: nothing
};

/// Appends the views of one source: a pinhole has one, others look through the faces of a cube.
void add_depth_views(const Mesh& mesh, const SourceInfo& source, std::vector<DepthView>& views);

/// The plane dot(per_depth, p) = 1; camera frame.
struct DepthPlane {
  Vec3d per_depth;
  double per_m = 0;  ///< length of per_depth

  Vec3d normal() const { return per_depth / -per_m; }  ///< towards the camera
  /// Signed distance, positive on the camera's side.
  double distance_m(Vec3d p) const { return (1 - dot(per_depth, p)) / per_m; }
};

/// The tangent plane of the surface where a point of the camera's frame is projected to, from
/// finite differences over the window: 1 / depth is linear over a plane. None in the picture's
/// margin, beside borders, depth jumps and sharp edges.
std::optional<DepthPlane> plane_at(const DepthView& view, Vec3d p_camera, double most_bend_m);

}  // namespace mr::calib
