#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/scene_reader.h"
#include "mr/core/secret_source.h"

/// Inside load_scene: the parts of a scene file.
namespace mr::scene_file {

/// An id with the line where it stands.
struct NodeName {
  std::string id;
  int line = 0;
};

/// Files named by a list, by one string, or by {pattern, first, last}; at least one of them exists
/// where no problem was reported.
struct FileList {
  std::vector<std::filesystem::path> paths;
  std::vector<int> lines;  ///< [paths] where each is named
  bool is_pattern = false;
  std::map<std::size_t, Error> unusable;  ///< some of the paths, and what is wrong with each
};

std::optional<FileList> read_files(Report& report, const YamlNode& node, const std::string& name);
/// The same from a mapping that holds pattern, first and last.
std::optional<FileList> read_pattern(MapReader& map, const std::string& name);

/// Notes what of a list cannot be used, where the rest can; `key`: in the scene, such as
/// "sensors.cam-0.source.depth".
void tell_unusable(Report& report, const FileList& list, const std::string& key);

std::optional<Camera> read_camera(Report& report, const YamlNode& node, const std::string& name);

/// A sensor's poses: 16 numbers, {file: …}, {files: […]} or {pattern, first, last}.
void read_poses(Report& report, const YamlNode& node, const std::string& name,
                SensorConfig& sensor);
/// 16 numbers.
std::optional<Pose> read_pose(Report& report, const YamlNode& node, const std::string& name);

/// The sensors in the file's order; a broken one keeps its place and its id. `names`: those that
/// have an id.
std::vector<SensorConfig> read_sensors(Report& report, const YamlNode& node,
                                       std::vector<NodeName>& names);

/// A synthetic rig and what happens in it.
RigConfig read_rig(Report& report, const YamlNode& node);

/// [[x, y, z], [x, y, z]]: the low and the high corner. Nothing where the key is missing or wrong.
std::optional<Box3d> read_box(MapReader& map, const std::string& key);

struct MergerEntry {
  MergerConfig config;
  int line = 0;
  int region_line = 0;           ///< 0: it has none
  std::vector<int> input_lines;  ///< [inputs]
};

std::vector<MergerEntry> read_mergers(Report& report, const YamlNode& node);
std::vector<LinkConfig> read_links(Report& report, const YamlNode& node,
                                   const std::vector<NodeName>& names);

/// Where a secret stands: {env: NAME} or {file: PATH}. Whether it is there is not looked at: each
/// node of a scene has only its own. False where the key is missing or wrong.
bool read_secret_source(MapReader& map, const std::string& key, SecretSource& out);

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
