#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/render/renderer.h"

namespace mr::eval {

/// Options of planning viewpoints (docs/evaluation.md, Viewpoints).
struct ViewpointConfig {
  int views = 30;
  int width = 960, height = 720;
  double vertical_fov_deg = 60;
  double cell_m = 0.05;
  double obstacle_low_m = 0.3, obstacle_high_m = 1.8;  ///< above the floor
  double clearance_m = 0.4;
  std::vector<double> eye_heights_m{1.2, 1.65};
  double least_cover = 0.25;      ///< of the picture
  double least_distance_m = 0.5;  ///< median depth
};

/// Occupancy grid of the floor; row 0 is at the lowest y of the floor frame.
struct FloorMap {
  enum Cell : std::uint8_t { unknown, free, obstacle };
  int width = 0, height = 0;
  double cell_m = 0.05;
  Pose T_world_floor;  ///< floor frame: z up, origin at the corner of cell (0, 0), on the floor
  std::vector<std::uint8_t> cells;     ///< [height * width] of Cell
  std::vector<float> clearance_m;      ///< [height * width] to the nearest cell that is not free
  std::vector<std::uint8_t> skeleton;  ///< [height * width] 1 on the generalised Voronoi diagram
};

struct ViewPlan {
  enum class Kind { voronoi, arcs } kind = Kind::voronoi;
  std::vector<render::Viewpoint> views;  ///< in the order in which they were chosen
  FloorMap floor;                        ///< empty for arcs
};

/// An undistorted pinhole with square pixels, its axis through the middle of the picture.
Camera picture_camera(int width, int height, double vertical_fov_deg);

/// Plans viewpoints for the evaluation: where a person could stand in the captured place, along the
/// generalised Voronoi diagram of its floor (paper 6.1, Voronoi planner), or, if nobody could stand
/// there, on arcs between the sensors. Cameras in a room look 10 degrees down; those on arcs look
/// at the surface's centre, and are nearer than the sensors if it would be too small in the
/// picture. `captured`: the surface that the sensors saw, world frame; `sensors`: poses of their
/// depth cameras; `up`: unit length. Deterministic. invalid: a position is not finite; empty: no
/// viewpoint sees enough of the surface.
Result<ViewPlan> plan_viewpoints(const Mesh& captured, std::span<const Pose> sensors, Vec3d up,
                                 const ViewpointConfig& config = {});

/// A floor plan with obstacles, skeleton, sensors and the chosen views as arrows.
std::string draw_plan_svg(const ViewPlan& plan, std::span<const Pose> sensors);

/// The file of viewpoints beside a scene file: JSON with kind, picture size, field of view and each
/// view's name and pose. `key` identifies the scene they were planned for. read_viewpoints()
/// returns invalid for a file with another key, unless `key` is empty.
Status write_viewpoints(const std::filesystem::path& file, const ViewPlan& plan,
                        const std::string& key);
Result<ViewPlan> read_viewpoints(const std::filesystem::path& file, const std::string& key);

}  // namespace mr::eval
