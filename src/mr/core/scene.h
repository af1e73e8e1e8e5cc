#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/lattice.h"
#include "mr/core/network_config.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/core/secret_source.h"

/// A scene file as a value: what scene-example.yaml describes. Lengths in metres, angles in
/// degrees, times in milliseconds unless a name says otherwise. Defaults are those of a file that
/// leaves the key out.
namespace mr {

/// Colour and depth as files; item i of one belongs to item i of the other.
struct RgbdImagesSource {
  std::vector<std::filesystem::path> color;  ///< JPEG or PNG; empty: the sensor has no colour
  std::vector<std::filesystem::path> depth;  ///< 16-bit PNG or PGM
  double depth_unit_m = 0.001;               ///< metres per count
  std::vector<std::uint16_t> invalid{0};     ///< counts that mean "no depth"
  bool loop = false;                         ///< start again after the last
  friend bool operator==(const RgbdImagesSource&, const RgbdImagesSource&) = default;
};

/// One sensor of the synthetic rig; which one follows from its place in the rig: the Kinects come
/// first, then the LiDARs.
struct SyntheticSource {
  std::uint32_t camera = 0;
  friend bool operator==(const SyntheticSource&, const SyntheticSource&) = default;
};

struct SensorConfig {
  std::string id;
  std::variant<RgbdImagesSource, SyntheticSource> source;
  Camera depth_camera;
  std::optional<Camera> color_camera;  ///< none: the sensor has no colour
  Pose T_color_depth;                  ///< depth-camera point → colour camera
  std::vector<Pose> T_world_depth;     ///< one for a static sensor, else one per item
  double depth_near_m = 0.3, depth_far_m = 5.0;
  Precision precision;
  double clock_offset_ms = 0;  ///< added to the source's times
  /// Items whose pose file is missing or cannot be used, and why: their frames are lost. In
  /// T_world_depth they have a neighbour's.
  std::map<std::size_t, Error> lost_poses{};
  friend bool operator==(const SensorConfig&, const SensorConfig&) = default;
};

struct MergerConfig {
  std::string id;
  std::vector<std::string> inputs;  ///< ids of sensors or mergers
  double deadline_ms = 50;          ///< waits this long for the slowest input
  double budget_ms = 0;  ///< merging should take no longer: what only improves the surface is then
                         ///< left out; 0: no limit
  /// Spatial split: the merger owns the surface in here, and takes no other. Its inputs may feed
  /// other mergers with a region, too.
  std::optional<Box3d> region{};
  friend bool operator==(const MergerConfig&, const MergerConfig&) = default;
};

struct LinkConfig {
  std::string from, to;
  double limit_mbps = 0;
  friend bool operator==(const LinkConfig&, const LinkConfig&) = default;
};

enum class Decomposition { none, chunks, patches };

/// What is done to a sensor's depth before fusion (fusion/clean_depth.h). In a scene file these are
/// keys of `fusion`.
struct CleanConfig {
  bool mixed_pixels = true;  ///< drop what hangs between two surfaces at a depth edge
  int speckle_px = 8;        ///< drop regions of fewer pixels; 0 or 1: none
  int fill_px = 2;           ///< close gaps of up to so many pixels inside a surface, 0 (off) .. 7
  bool smooth_depth = true;  ///< average out sensor noise
  friend bool operator==(const CleanConfig&, const CleanConfig&) = default;
};

struct FusionConfig {
  Decomposition decomposition = Decomposition::chunks;
  double chunk_m = 1.28;             ///< edge of the scene's chunk grid
  int patches_x = 4, patches_y = 4;  ///< the paper's M×N
  double truncation_m = 0.04;        ///< half width of the signed-distance band
  CleanConfig clean;                 ///< keys smooth_depth, mixed_pixels, speckle_px, fill_px
  friend bool operator==(const FusionConfig&, const FusionConfig&) = default;
};

struct SimplifyConfig {
  double ratio = 1;    ///< triangles kept, (0, 1]
  double error_m = 0;  ///< no collapse costs more; 0: any. Alone, it decides alone
  friend bool operator==(const SimplifyConfig&, const SimplifyConfig&) = default;
};

struct MergeConfig {
  enum class Owner { paper, coherent } owner = Owner::coherent;
  enum class Overlap { rays, raster } overlap = Overlap::raster;
  bool refine = false;
  bool color_gain = false;
  SimplifyConfig simplify;
  double calibration_error_m = 0.005;  ///< how far two sensors may disagree, 1 sigma
  double island_area_m2 = 0;           ///< smaller components go; 0: what suits the voxel
  double gap_m = 0;                    ///< wider gaps between sensors stay open; 0: 2.5 voxels
  double leave_out_mm = 0;  ///< a sensor whose surface lies farther than this from its neighbours'
                            ///< is left out; 0: it is told, and stays
  friend bool operator==(const MergeConfig&, const MergeConfig&) = default;
};

struct AtlasConfig {
  enum class Views { coherent, best_angle, packed, separate } views = Views::coherent;
  bool mask = true;                 ///< pixels of no use become black
  bool burn_sequence = false;       ///< test pictures: the packet's number in the corner
  int width = 4096, height = 2304;  ///< the atlas is at most this large
  friend bool operator==(const AtlasConfig&, const AtlasConfig&) = default;
};

/// The scene's two surfaces (DESIGN section 9): what stays is kept, what moves is made anew.
struct StillConfig {
  bool layers = true;  ///< false: everything is made anew with every capture
  double after_s = 5;  ///< what stopped becomes part of the room after so long
  friend bool operator==(const StillConfig&, const StillConfig&) = default;
};

struct RateConfig {
  enum class Model { fixed, lookup, classifier, ours } model = Model::fixed;
  double target_mbps = 20;
  friend bool operator==(const RateConfig&, const RateConfig&) = default;
};

struct CodingConfig {
  double texture_scale = 1;
  int texture_qp = 28;
  int sensor_texture_qp = 22;  ///< between sensor and first merger
  int depth_qp = 14;           ///< pipeline rgbd: of its depth video
  int frame_divider = 1;       ///< baselines: every n-th capture is sent
  friend bool operator==(const CodingConfig&, const CodingConfig&) = default;
};

struct VideoConfig {
  int threads = 2, slices = 2;  ///< libx264's bytes follow them
  friend bool operator==(const VideoConfig&, const VideoConfig&) = default;
};

/// Something that happens in a synthetic rig, told by the rig's captures: its frames 0, 1, …, again
/// from 0 where it loops. Which fields count follows from the kind.
struct RigEvent {
  enum class Kind {
    sit,       ///< somebody walks in, sits from `at` on for `frames`, gets up and leaves
    chair,     ///< a chair is moved by `by_m`, from `at` on, within `frames`
    door,      ///< a door opens at `at` and begins to close `frames` later; either takes a second
    carry,     ///< somebody walks in, picks up a box at `at` and carries it away
    vanish,    ///< a box is gone from `at` on; who stands before `sensor` for `frames` hides that
    light,     ///< light falls to the share `level` at `at`, and is back after `frames`
    screen,    ///< a screen plays from `at` on for `frames`, else it stands still
    push,      ///< `sensor` is moved by by_mm and turned by by_deg at `at`; its stated pose is not
    dropout,   ///< `sensor` measures no depth from `at` on for `frames`
    exposure,  ///< the exposure of `sensor` is off by `stops` from `at` on for `frames`
    hunt,      ///< it swings by ± `stops` and back in `period_s`, from `at` on for `frames`
  } kind = Kind::sit;
  int at = 0;
  int frames = 0;                ///< how long; usual_frames(kind) where a file leaves it out
  std::string sensor;            ///< an id of the rig; empty: all, of `vanish` none
  std::optional<Vec2d> place_m;  ///< on the floor, room frame; none: a free place
  double by_m = 1;
  double by_mm = 30, by_deg = 2;
  double level = 0.2;
  double stops = 1, period_s = 1;
  friend bool operator==(const RigEvent&, const RigEvent&) = default;
};

/// How long an event of a scene file without `frames` takes, in captures.
int usual_frames(RigEvent::Kind kind);
/// The word of a scene file for a kind.
const char* name_of(RigEvent::Kind kind);

/// A synthetic rig in place of `sensors`. Errors are drawn from the seed, one set per sensor.
struct RigConfig {
  enum class Kind { room, conference, office, corridor, hallway } kind = Kind::room;
  std::uint32_t seed = 1;
  Vec3d room_m{6, 5, 3};  ///< width, depth, height
  int people = 0;         ///< who walk and gesture
  int sensors = 4;        ///< Kinects, "cam-0" and so on; 1 to 400
  int lidars = 0;         ///< 360-degree LiDARs with a panorama, "lidar-0" and so on
  int depth_width = 640,
      depth_height = 576;  ///< depth_mode nfov; wfov_binned 512x512, nfov_binned 320x288
  int color_width = 1280, color_height = 720;
  bool noise = true;          ///< `kinect`; `none` is noiseless
  double depth_noise = 1;     ///< its deviation, as a multiple of what the sensor's precision says
  double depth_noise_px = 0;  ///< how far it is correlated: exp(-r² / (2 px²)); 0: not at all
  double color_noise = 0;     ///< deviation of every colour value of a frame, in 8-bit levels
  double exposure_drift = 0;  ///< stops: exposure swings slowly by ± this, each camera by itself
  double exposure_period_s = 20;  ///< of that swing
  double calib_error_mm = 0;      ///< each stated pose is off by so much, in some direction
  double calib_error_deg = 0;     ///< and turned by so much, about some axis
  double exposure_spread =
      0;  ///< stops: exposure is off by up to ± this, red and blue by a quarter
  double clock_offset_ms = 0;  ///< each clock is off by up to ± this; the stated times do not tell
  double detail = 0.5;         ///< texture contrast and clutter, 0..1
  int frames = 300;            ///< the source ends, or starts again, after so many
  bool loop = false;           ///< start again; then motion repeats after `frames`
  std::vector<RigEvent> events;

  /// The ids of its sensors, in order.
  std::vector<std::string> sensor_ids() const;
  friend bool operator==(const RigConfig&, const RigConfig&) = default;
};

/// A size that suits a kind of room; what a scene file without `room` means.
Vec3d usual_room_m(RigConfig::Kind kind);

/// What a scene's pictures were made from, for measuring: written by `synth`.
struct TruthConfig {
  std::string mesh;              ///< pattern of PLY files in world coordinates, one per frame
  std::optional<RigConfig> rig;  ///< the rig that made them
  friend bool operator==(const TruthConfig&, const TruthConfig&) = default;
};

/// The floor as a plane: what is at most `margin_m` above it is dropped before fusion.
struct FloorConfig {
  double height_m = 0;     ///< along the scene's up
  double margin_m = 0.03;  ///< sensor noise and calibration
  friend bool operator==(const FloorConfig&, const FloorConfig&) = default;
};

/// A model of what never moves: sent once, drawn with depth (paper, Fig. 11).
struct BackgroundConfig {
  std::filesystem::path model;  ///< .glb
  Pose T_world_model;
  friend bool operator==(const BackgroundConfig&, const BackgroundConfig&) = default;
};

/// Where a viewer starts; metres, world frame.
struct StartConfig {
  Vec3d eye, look_at;
  friend bool operator==(const StartConfig&, const StartConfig&) = default;
};

/// With what the gateway speaks TLS.
struct TlsConfig {
  std::filesystem::path cert, key;  ///< PEM files; both empty: a certificate of its own
  friend bool operator==(const TlsConfig&, const TlsConfig&) = default;
};

struct GatewayConfig {
  std::string listen = "127.0.0.1:8080";  ///< host:port; port 0: any free one
  std::optional<StartConfig> start{};     ///< none: the viewer looks for a good place
  std::optional<TlsConfig> tls{};         ///< none: plain HTTP
  SecretSource tokens{};                  ///< of those who may watch; empty: anybody
  std::vector<std::string> hosts{};       ///< names that it answers for; empty: see WebConfig
  bool open = false;                      ///< beyond this machine without TLS and tokens, knowingly
  int viewers = 64;                       ///< at once
  int viewers_per_address = 16;
  friend bool operator==(const GatewayConfig&, const GatewayConfig&) = default;
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
  friend bool operator==(const Scene&, const Scene&) = default;
};

/// Something wrong in a scene file; prints as "file:line: message". Or with what was set beside it;
/// prints as "--set 'key=value': message".
struct SceneProblem {
  std::filesystem::path file;
  int line = 0;  ///< 1-based; 0: the file as a whole
  std::string message;
  std::optional<std::string> option = {};  ///< "key=value"; none: it stands in the file
};
std::string to_string(const SceneProblem& problem);

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
