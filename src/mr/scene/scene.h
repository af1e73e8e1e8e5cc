#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "mr/atlas/atlas_config.h"
#include "mr/codec/coding_config.h"
#include "mr/core/lattice.h"
#include "mr/core/range.h"
#include "mr/core/sensor_config.h"
#include "mr/fusion/fusion_config.h"
#include "mr/kit/video_config.h"
#include "mr/merge/merge_config.h"
#include "mr/model/background.h"
#include "mr/net/network_config.h"
#include "mr/rate/rate_config.h"
#include "mr/scene/gateway_config.h"
#include "mr/scene/tree_config.h"
#include "mr/sensor/floor.h"
#include "mr/simplify/simplify_config.h"
#include "mr/still/still_config.h"
#include "mr/synth/rig_config.h"
#include "mr/yaml/problem.h"

/// A scene file as a value: what scene-example.yaml describes. Each stage's config stands in the
/// stage's own module; here they are put together. Lengths in metres, angles in degrees, times in
/// milliseconds unless a name says otherwise. Defaults are those of a file that leaves the key out.
namespace mr {

using atlas::AtlasConfig;
using codec::CodingConfig;
using fusion::CleanConfig;
using fusion::Decomposition;
using fusion::FusionConfig;
using kit::VideoConfig;
using model::BackgroundConfig;
using net::NatsConfig;
using net::NetworkConfig;
using rate::RateConfig;
using sensor::FloorConfig;
using simplify::SimplifyConfig;
using still::StillConfig;
using synth::RigConfig;
using synth::RigEvent;
using SceneProblem = yaml::Problem;

/// The key `merge`: how surfaces are merged, and how far the root decimates what comes out.
struct MergeConfig : merge::MergeConfig {
  SimplifyConfig simplify;

  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const;
  friend bool operator==(const MergeConfig&, const MergeConfig&) = default;
};

/// What a scene's pictures were made from, for measuring: written by `synth`.
struct TruthConfig {
  std::string mesh;              ///< pattern of PLY files in world coordinates, one per frame
  std::optional<RigConfig> rig;  ///< the rig that made them
  friend bool operator==(const TruthConfig&, const TruthConfig&) = default;
};

struct Scene {
  std::filesystem::path file;
  std::vector<std::string> set;  ///< "key=value": what was set beside the file
  std::string id;
  Vec3d up{0, 0, 1};  ///< unit length
  double fps = 30;
  int threads = 0;  ///< 0 = all cores
  double voxel_m = 0.01;
  Lattice lattice;
  VideoConfig video;
  std::optional<Box3d> volume;
  std::optional<FloorConfig> floor;
  std::optional<BackgroundConfig> background;
  std::vector<SensorConfig> sensors;
  std::optional<RigConfig> rig;
  std::optional<TruthConfig> truth;
  std::vector<MergerConfig> mergers;  ///< children before parents; the last is the root
  std::vector<LinkConfig> links;
  std::string pipeline = "meshreduce";
  FusionConfig fusion;
  SimplifyConfig simplify;
  MergeConfig merge;
  AtlasConfig atlas;
  bool reuse_chunks = true;
  StillConfig still;
  RateConfig rate;
  CodingConfig coding;
  std::optional<GatewayConfig> gateway;
  NetworkConfig network;

  const SensorConfig& sensor(SensorId which) const { return sensors[index_of(which)]; }

  static constexpr Range kFps{0, 240, true}, kThreads{0, 1024}, kVoxel_m{0.002, 0.05};
  static constexpr std::array<const char*, 5> kPipelines{"meshreduce", "holoportation",
                                                         "holoportation++", "points", "rgbd"};
  /// The invalid fields, one line each that names the key ("fusion.chunk_m must be …"); empty: the
  /// scene can be run. Files, the tree's shape and ids are checked by load_scene() alone.
  std::vector<std::string> problems() const;
  friend bool operator==(const Scene&, const Scene&) = default;
};

struct SceneResult {
  Scene scene;                         ///< usable only when `problems` is empty
  std::vector<SceneProblem> problems;  ///< all that is wrong, by line; of options first, alone
  /// Accepted, but not acted on by this version; files of a list that are not there.
  std::vector<SceneProblem> notices;
};

/// Reads and checks a scene file. Unknown and doubled keys, missing files, impossible intrinsics,
/// poses that are not rigid, ids used twice, unknown inputs and cycles in the tree of mergers are
/// all found in one go. Where some files of a list are there, those that are not cost their frames
/// only. ${NAME} and ${NAME:-default} are expanded in strings; relative paths are
/// relative to the file. `set` changes keys of the file before it is checked: "voxel_m=0.02",
/// "merge.simplify.ratio=0.5", "sensors.cam-0.depth_range_m=[0.3, 4]".
SceneResult load_scene(const std::filesystem::path& file, const std::vector<std::string>& set = {});

/// The same from the text of a file, which need not exist.
SceneResult parse_scene(const std::string& text, const std::filesystem::path& file,
                        const std::vector<std::string>& set = {});

}  // namespace mr
