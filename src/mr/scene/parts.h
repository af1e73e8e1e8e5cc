#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "mr/scene/scene.h"
#include "mr/yaml/files.h"
#include "mr/yaml/map_reader.h"

/// Inside load_scene: the parts of a scene file.
namespace mr::scene_file {

using yaml::FileList;
using yaml::MapReader;
using yaml::Report;

/// An id with the line where it stands.
struct NodeName {
  std::string id;
  int line = 0;
};

std::optional<Camera> read_camera(Report& report, const yaml::Node& node, const std::string& name);

/// A sensor's poses: 16 numbers, {file: …}, {files: […]}, {pattern, first, last} or {trajectory: …,
/// T_trajectory_depth: 16 numbers}. The source's config is known by then.
void read_poses(Report& report, const yaml::Node& node, const std::string& name,
                SensorConfig& sensor);
/// 16 numbers.
std::optional<Pose> read_pose(Report& report, const yaml::Node& node, const std::string& name);

/// The sensors in the file's order; a broken one keeps its place and its id. `names`: those that
/// have an id.
std::vector<SensorConfig> read_sensors(Report& report, const yaml::Node& node,
                                       std::vector<NodeName>& names);

/// A synthetic rig and what happens in it.
RigConfig read_rig(Report& report, const yaml::Node& node);

/// [[x, y, z], [x, y, z]]: the low and the high corner. Nothing where the key is missing or wrong.
std::optional<Box3d> read_box(MapReader& map, const std::string& key);

struct MergerEntry {
  MergerConfig config;
  int line = 0;
  int region_line = 0;           ///< 0: it has none
  std::vector<int> input_lines;  ///< [inputs]
};

std::vector<MergerEntry> read_mergers(Report& report, const yaml::Node& node);
std::vector<LinkConfig> read_links(Report& report, const yaml::Node& node,
                                   const std::vector<NodeName>& names);

void read_background(MapReader& top, std::optional<BackgroundConfig>& background);

/// Gateway, NATS and TCP addresses; the scene's sensors and mergers are known by then.
void read_network(MapReader& top, Scene& scene);

/// Sensors and mergers share one namespace: reports ids used twice.
void check_ids(Report& report, const std::vector<NodeName>& leaves,
               const std::vector<MergerEntry>& mergers);

/// Checks that sensors and mergers form one tree, in which mergers that share the space may share
/// inputs, and that regions lie on the chunk grid; children before parents, the root last.
/// `leaves_known` is false where the sensors could not be read: then unknown inputs are no problem
/// of their own.
std::vector<MergerConfig> ordered_tree(Report& report, const std::vector<NodeName>& leaves,
                                       const std::vector<MergerEntry>& mergers, double chunk_m,
                                       bool leaves_known);

}  // namespace mr::scene_file
