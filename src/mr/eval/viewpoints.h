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

/// EVALUATION, Viewpoints.
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

/// The floor as cells of cell_m; row 0 is at the lowest y of the floor frame.
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

/// Chooses viewpoints from which somebody would look at a captured place (paper 6.1: Voronoi
/// planner), or on arcs between the sensors where nobody could stand in it. Cameras in a room look
/// 10 degrees down; those on arcs look at the middle of the surface, from nearer than the sensors
/// where it would be too small in the picture. Deterministic. invalid: a position is not finite.
/// `captured`: the surface that the sensors saw, world frame; `sensors`: their depth cameras'
/// poses; `up`: unit length. empty: no viewpoint sees enough.
Result<ViewPlan> plan_viewpoints(const Mesh& captured, std::span<const Pose> sensors, Vec3d up,
                                 const ViewpointConfig& config = {});

/// A floor plan with obstacles, skeleton, sensors and the chosen views as arrows.
std::string draw_plan_svg(const ViewPlan& plan, std::span<const Pose> sensors);

/// Viewpoints as stored beside a scene file: JSON with kind, picture size, field of view and each
/// view's name and pose. `key` names what they were planned for; read_viewpoints() refuses
/// (invalid) a file of another key, unless `key` is empty.
Status write_viewpoints(const std::filesystem::path& file, const ViewPlan& plan,
                        const std::string& key);
Result<ViewPlan> read_viewpoints(const std::filesystem::path& file, const std::string& key);

}  // namespace mr::eval
