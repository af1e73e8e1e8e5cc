// schema/scene.schema.json against the reader of scene files, and docs/scene-file.md against the
// schema. MR_WRITE_DOCS=1 writes the tables of the page anew.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <charconv>
#include <functional>
#include <map>
#include <set>
#include <sstream>

#include "core/temp_dir.h"
#include "mr/core/file.h"
#include "mr/kit/image_io.h"
#include "mr/scene/scene.h"
#include "mr/yaml/tree.h"
#include "scene/json_schema.h"
#include "support/recordings.h"
#include "support/video_files.h"

namespace mr {
namespace {

using test::Json;
using test::JsonSchema;
using testing::IsEmpty;

/// What the reader checks and a schema cannot say: what its message holds, why, and how it ends.
struct BeyondSchema {
  const char *message, *why, *end = "";
};
constexpr BeyondSchema kBeyondSchema[] = {
    {"no such file", "files exist"},
    {"no folder ", "files exist"},
    {"is a folder, not a file", "files exist"},
    {"model: no file", "files exist"},
    {"of the pattern", "files exist"},
    {"must name a file, not ''", "the text after the environment is expanded"},
    {"times: ", "what the file holds"},
    {"sender: ", "the text is a numeric address"},
    {"of one of depth.txt", "what the files hold"},
    {"has at most", "two keys"},
    {"a frame's time", "another key gives it"},
    {"must be a multiple of 10", "arithmetic"},
    {"twice as wide as high", "two numbers of one list"},
    {"serial must have", "the text after the environment is expanded"},
    {"source names both serial and device", "two keys"},
    {"source needs serial", "two keys"},
    {"too many files", "two keys: first and last"},
    {"last must not be less than first", "two keys"},
    {"they must be as many", "two lists of one length"},
    {"color_camera is given but source names no color", "two keys of two mappings"},
    {"source names color but color_camera is missing", "two keys of two mappings"},
    {"poses for", "two lists of one length"},
    {"pose is not rigid", "geometry"},
    {"focal lengths do not fit the size", "geometry"},
    {"principal point", "geometry"},
    {"distortion folds", "geometry"},
    {"beam_altitude_deg must be a list of", "as many numbers as size says", "of them"},
    {"beam_azimuth_deg must be a list of", "as many numbers as size says", "of them"},
    {"must be [near, far]", "two numbers in order"},
    {"up must be a direction", "not all of three numbers 0"},
    {"look_at must be another place than eye", "two keys"},
    {"must be multiples of the lattice's step", "another key gives the step"},
    {", which is for pipeline points", "another key gives the range"},
    {"outside the lattice's cube", "pose, range and lattice together"},
    {"voxels of voxel_m", "another key gives the unit"},
    {"is empty: its first corner", "two corners in order"},
    {"region must lie on the chunk grid", "another key gives the grid"},
    {"the regions of mergers", "two mergers"},
    {"is used twice", "ids of the whole file"},
    {"is no sensor and no merger", "ids of the whole file"},
    {"is already an input of merger", "one tree"},
    {"reaches no root", "one tree"},
    {"more than one root", "one tree"},
    {"mergers form a cycle", "one tree"},
    {"is the merger's where 'mergers' is left out", "ids of the whole file"},
    {", after the rig's last, ", "two keys"},
    {", which is no sensor of the rig", "ids of the rig"},
    {"has a place outside the rig's room", "two keys"},
    {"cert and key only together", "two keys"},
    {"either nkey or credentials", "two keys"},
    {"needs tls:// in the url", "two keys"},
    {"more problems follow", "of those above"},
};

/// Every key of the schema stands in one of these scenes. They are valid.
constexpr const char* kImages = R"(
scene: s
up: [0, 0, 1]
fps: 25
threads: 2
voxel_m: 0.02
pipeline: meshreduce
lattice: {origin: [1, 0, 0], step_exp: -9}
video: {threads: 3, slices: 3}
volume: {box: [[-4, -4, -4], [4, 4, 4]], remove_floor: {height_m: 0.1, margin_m: 0.05}}
background: {model: m.glb, T_world_model: [1, 0, 0, 2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}
sensors:
  - id: a
    source: {type: rgbd-images, color: [c.png], depth: [d.png], depth_unit_m: 0.002, invalid: [0, 9], loop: true}
    depth_camera: {model: pinhole, size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240}
    color_camera: {size: [640, 480], fx: 500, fy: 500, cx: 320, cy: 240,
                   distortion: {model: rational, k: [0.01, 0, 0, 0, 0], p: [0.001, 0], most_radius: 1.7}}
    T_color_depth: [1, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    T_world_depth: {file: pose-0.txt}
    depth_range_m: [0.4, 4]
    precision: {base_m: 0.002, per_m2: 0.001}
    clock_offset_ms: 3
  - id: b
    source: {type: rgbd-images, depth: {pattern: "d%d.png", first: 0, last: 1}, invalid: 7}
    depth_camera: {size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240, distortion: {model: brown, k: [0.01]}}
    T_world_depth: {pattern: "pose-%d.txt", first: 0, last: 1}
mergers:
  - {id: w, inputs: [a, b], deadline_ms: 60, budget_ms: 20, region: [[-1.28, 0, 0], [0, 1.28, 1.28]]}
  - {id: e, inputs: [a, b], region: [[0, 0, 0], [1.28, 1.28, 1.28]]}
  - {id: r, inputs: [w, e]}
links: [{from: a, to: w, limit_mbps: 50}]
fusion: {decomposition: chunks, chunk_m: 1.28, patches: [2, 3], truncation_m: 0.07,
         mixed_pixels: false, speckle_px: 4, fill_px: 1, smooth_depth: false}
simplify: {ratio: 0.5, error_m: 0.002}
merge: {owner: paper, overlap: rays, refine: true, color_gain: true, simplify: {ratio: 0.5, error_m: 0.002},
        calibration_error_m: 0.01, island_area_m2: 0.1, gap_m: 0.1, agree_m: 0.03, fill_m: 0.1, leave_out_mm: 50}
atlas: {views: best_angle, mask: false, size: [512, 256], burn_sequence: true}
reuse: {chunks: false}
still: {layers: true, after_s: 3}
rate: {model: fixed, target_mbps: 10, rungs: 2, model_file: models.json}
coding: {texture_scale: 0.5, texture_qp: 30, sensor_texture_qp: 20, depth_qp: 10, frame_divider: 1}
gateway: {listen: "0.0.0.0:80", start: {eye: [1, 1, 1.6], look_at: [0, 0, 1]}, tls: {cert: c.pem, key: k.pem},
          tokens: {file: tokens}, hosts: [room.example.org, "fe80::1"], open: true, viewers: 10, viewers_per_address: 2}
nats: {url: "tls://127.0.0.1:4222", ca: ca.pem, cert: node.pem, key: node.key,
       nkey: {public: UDXU4RCSJNZOIQHZNWXHXORDPRTGNJAHAHFRGZNEEJCPQTT2M7NLCNF4, seed: node.nk}}
tcp: {a: "127.0.0.1:9000", w: "[::1]:9001", secret: {env: TCP_SECRET}}
truth:
  mesh: "%06d.ply"
  rig: {seed: 7}
)";
constexpr const char* kRig = R"(
scene: s
rig: {type: synthetic, kind: corridor, seed: 2, room: [2, 12, 3], people: 1, sensors: 3, lidars: 1, depth_mode: wfov,
      lidar_beams: 64, lidar_noise_mm: 20, color: [640, 360], noise: none, calib_error_mm: 1, calib_error_deg: 1, exposure_spread: 1, clock_offset_ms: 1,
      detail: 0.25, frames: 100, loop: true, depth_noise: 2, depth_noise_px: 2, color_noise: 2, exposure_drift: 0.25,
      exposure_period_s: 30, events: [
        {kind: sit, at: 60, frames: 30, place: [0.5, -1]}, {kind: chair, at: 10, frames: 20, place: [0, 1], by_m: 0.7},
        {kind: door, at: 10, frames: 40}, {kind: carry, at: 50, place: [0, 2]},
        {kind: vanish, at: 40, frames: 30, place: [0, -2], sensor: cam-1}, {kind: light, at: 30, frames: 20, level: 0.1},
        {kind: screen, at: 0, frames: 50, place: [0, 3]}, {kind: push, at: 70, sensor: cam-2, by_mm: 20, by_deg: 1},
        {kind: dropout, at: 5, frames: 10, sensor: cam-1}, {kind: exposure, at: 1, frames: 2, sensor: cam-0, stops: -1},
        {kind: hunt, at: 2, frames: 3, sensor: cam-0, stops: 0.5, period_s: 0.5}]}
)";
constexpr const char* kLidar = R"(
scene: s
sensors:
  - id: a
    source: {type: rgbd-images, depth: d.png, color: c.png}
    depth_camera: {model: lidar, size: [1024, 2], beam_altitude_deg: [10, -10], beam_azimuth_deg: [1, -1]}
    color_camera: {model: equirectangular, size: [1024, 512]}
    T_world_depth: {files: [pose-0.txt]}
  - id: b
    source: {type: rgbd-images, depth: d.png}
    depth_camera: {model: lidar, size: [1024, 3], beam_altitude_deg: {from: 10, to: -10}}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
nats: {url: "nats://127.0.0.1:4222", credentials: node.creds}
tcp: {a: "127.0.0.1:9000", secret: {file: secret.txt}}
gateway: {tls: auto}
)";
constexpr const char* kRecordings = R"(
scene: s
sensors:
  - id: a
    source: {type: azure-kinect-mkv, file: kinect.mkv, calibration: calibration.json, loop: true}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    clock_drift_ppm: 20
    moving: true
  - id: b
    source: {type: ouster-pcap, file: turns.pcap, metadata: turns.json, texture: reflectivity, sender: 192.168.1.10, loop: true}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: c
    source: {type: ouster, metadata: turns.json, texture: none, sender: 192.168.1.11, address: 192.168.1.2, port: 7504}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: d
    source:
      type: lidar-360
      lidar: {type: ouster-pcap, file: turns.pcap, metadata: turns.json}
      color: {pictures: sphere.png, fps: 10, offset_ms: 5, yaw_deg: 90, stated_pose: false, loop: true}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: e
    source:
      type: lidar-360
      lidar: {type: rgbd-images, depth: d.png}
      color: {video: film.mp4}
    depth_camera: {model: lidar, size: [1024, 3], beam_altitude_deg: {from: 10, to: -10}}
    color_camera: {model: equirectangular, size: [64, 32]}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: f
    source: {type: tum, folder: desk, depth_unit_m: 0.0004, invalid: [0, 3], max_apart_ms: 30, loop: true}
    depth_camera: {size: [64, 48], fx: 50, fy: 50, cx: 32, cy: 24}
    color_camera: {size: [64, 48], fx: 50, fy: 50, cx: 32, cy: 24}
    T_world_depth: {trajectory: desk/groundtruth.txt, T_trajectory_depth: [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}
  - id: h
    source:
      type: lidar-360
      lidar: {type: ouster, metadata: turns.json}
      color:
        device: {path: /dev/video0, size: [2048, 1024], format: yuyv, fps: 15, exposure_us: 10000, gain: 10, white_balance_k: 4500}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: i
    source: {type: realsense-bag, file: realsense.bag, depth_unit_m: 0.002, loop: true}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: g
    source: {type: rgbd-images, depth: [d0.png, d1.png], times: times.txt}
    depth_camera: {size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
)";
constexpr const char* kDevices = R"(
scene: s
sensors:
  - id: a
    source: {type: k4a, serial: "000123456789", depth_mode: nfov_binned, color: 720p, fps: 15, sync: subordinate,
             subordinate_delay_us: 160, depth_delay_us: 80, exposure_us: 8330, gain: 100, white_balance_k: 4500,
             powerline_hz: 50, depth_unit_m: 0.00025}
    depth_camera: {size: [320, 288], fx: 252, fy: 252, cx: 160, cy: 144}
    color_camera: {size: [1280, 720], fx: 612, fy: 612, cx: 640, cy: 360}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: b
    source: {type: k4a, device: 1}
    depth_camera: {size: [640, 576], fx: 504, fy: 504, cx: 320, cy: 288}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
)";

/// Converts YAML to JSON: unquoted numbers, true and false get their types; all else is text.
Json as_json(const yaml::Node& node) {
  using Kind = yaml::Node::Kind;
  Json out;
  if (node.kind == Kind::list) {
    out = Json::array();
    for (const auto& item : node.items) out.push_back(as_json(item));
  } else if (node.kind == Kind::map) {
    out = Json::object();
    for (std::size_t i = 0; i < node.keys.size(); ++i)
      out[node.keys[i].name] = as_json(node.items[i]);
  } else if (node.kind == Kind::scalar) {
    const char* const end = node.text.data() + node.text.size();
    const auto is_all = [&](auto& number) {
      const auto [stop, failed] = std::from_chars(node.text.data(), end, number);
      return failed == std::errc() && stop == end;
    };
    std::int64_t whole = 0;
    double number = 0;
    if (node.quoted) return node.text;
    if (node.text == "true" || node.text == "false") return node.text == "true";
    if (is_all(whole)) return whole;
    if (is_all(number)) return number;
    return node.text;
  }
  return out;
}

Json json_of(const std::string& yaml) {
  const yaml::Tree tree = yaml::parse_yaml(yaml);
  EXPECT_EQ(tree.problem, "");
  return as_json(tree.root);
}

std::string text_of(const std::filesystem::path& file) {
  const auto bytes = read_file(file, 1 << 24);
  EXPECT_TRUE(bytes) << file;
  return bytes ? std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size()) : "";
}

/// A key of the schema: an entry of `properties` with a description. (Others only narrow one.)
bool is_key(const Json& schema) { return schema.is_object() && schema.contains("description"); }

/// A location in a scene, and the schema that applies there.
struct Place {
  Json::json_pointer at;
  std::string key;  ///< the last part of its path; of an item, its list's
  const Json* schema;
  bool is_required = false;
};

class SceneSchema : public testing::Test {
 protected:
  SceneSchema() {
    for (const char* file : {"c.png", "d.png", "d0.png", "d1.png", "m.glb"}) dir_.write(file, "x");
    for (const char* file : {"pose-0.txt", "pose-1.txt"})
      dir_.write(file, "1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1");
    write_recordings();
    for (const char* yaml : {kImages, kRig, kLidar, kRecordings, kDevices})
      bases_.push_back(json_of(yaml));
  }

  /// What kRecordings names.
  void write_recordings() {
    test::write_kinect_recording(dir_ / "kinect.mkv", dir_ / "calibration.json");
    test::write_ouster_recording(dir_ / "turns.pcap", dir_ / "turns.json");
    test::write_realsense_recording(dir_ / "realsense.bag");
    ASSERT_TRUE(kit::write_png(dir_ / "sphere.png", ImageRgb(64, 32)).ok());
    test::write_video(dir_ / "film.mp4", std::vector<ImageRgb>(3, ImageRgb(64, 32)), {});
    dir_.write("times.txt", "0.0\n0.1\n");
    dir_.write("desk/rgb.txt", "10.00 rgb/0.png\n");
    dir_.write("desk/depth.txt", "10.01 depth/0.png\n");
    dir_.write("desk/groundtruth.txt", "9.9 0 0 0 0 0 0 1\n10.1 0 0 0 0 0 0 1\n");
    for (const char* picture : {"desk/rgb/0.png", "desk/depth/0.png"}) dir_.write(picture, "x");
  }

  /// Whether a part of a schema is that of a source of another type than the value's.
  static bool is_of_other_type(const Json& part, const Json& value) {
    const Json::json_pointer type("/properties/type/anyOf/0/const");
    if (!value.is_object() || !part.is_object() || !part.contains(type)) return false;
    return value.value("type", Json()) != part.at(type);
  }

  /// What the reader accepts, the configs' own problems() must accept, too.
  SceneResult read(const Json& scene) {
    SceneResult result = parse_scene(scene.dump(), dir_ / "scene.yaml");
    if (result.problems.empty()) {
      EXPECT_THAT(result.scene.problems(), testing::IsEmpty()) << scene.dump();
    }
    return result;
  }

  static bool is_beyond_schema(const SceneProblem& problem) {
    return std::any_of(std::begin(kBeyondSchema), std::end(kBeyondSchema),
                       [&](const BeyondSchema& rule) {
                         return problem.message.find(rule.message) != std::string::npos &&
                                problem.message.ends_with(rule.end);
                       });
  }

  /// Every place of a scene that the schema knows of; all of an object list's items, of others one.
  std::vector<Place> places(const Json& scene) const {
    std::vector<Place> out;
    visit(scene, Json::json_pointer(), "", schema_.root(), out);
    return out;
  }

  void visit(const Json& scene, const Json::json_pointer& at, const std::string& key,
             const Json& schema, std::vector<Place>& out) const {
    const Json& value = scene.at(at);
    for (const Json* part : schema_.parts(schema)) {
      if (is_of_other_type(*part, value)) continue;
      if (value.is_object() && part->contains("properties"))
        for (const auto& [name, inner] : (*part)["properties"].items()) {
          if (!is_key(inner) || !value.contains(name)) continue;
          const Json required = part->value("required", Json::array());
          out.push_back({at / name, name, &inner,
                         std::find(required.begin(), required.end(), name) != required.end()});
          visit(scene, at / name, name, inner, out);
        }
      if (value.is_array() && part->contains("items"))
        for (std::size_t i = 0; i < (value.empty()          ? 0
                                     : value[0].is_object() ? value.size()
                                                            : 1);
             ++i) {
          out.push_back({at / i, key, &(*part)["items"]});
          visit(scene, at / i, key, (*part)["items"], out);
        }
    }
  }

  /// All keys of the schema, however deep.
  static void all_keys(const Json& schema, std::set<const Json*>& out) {
    if (!schema.is_structured()) return;
    if (schema.is_object() && schema.contains("properties"))
      for (const auto& [name, inner] : schema["properties"].items())
        if (is_key(inner)) out.insert(&inner);
    for (const auto& [name, inner] : schema.items()) all_keys(inner, out);
  }

  /// Empty: schema and reader agree on a scene; else the verdict of each.
  std::string disagreement(const Json& scene, const std::string& what) {
    const bool by_schema = schema_.accepts(scene);
    std::string refused;
    for (const SceneProblem& problem : read(scene).problems)
      if (!is_beyond_schema(problem)) refused = problem.message;
    if (by_schema == refused.empty()) return "";
    return what + ": the schema " + (by_schema ? "accepts" : "refuses") + ", the reader " +
           (refused.empty() ? "accepts" : "refuses: " + refused);
  }

  /// Values for a place that lie on both sides of what is allowed.
  std::vector<Json> values_to_try(const Place& place, const Json& now) const {
    constexpr std::int64_t kLarge = 1'000'000'000'000;
    std::vector<Json> out{
        nullptr, true,          "word",           "7",           0, 1, -1, 0.5, kLarge,
        -kLarge, Json::array(), Json::array({0}), Json::object()};
    if (!now.is_structured() && !now.is_boolean())
      out.push_back("${MR_NOT_SET:-" + (now.is_string() ? now.get<std::string>() : now.dump()) +
                    "}");
    if (now.is_boolean()) out.push_back(now.get<bool>() ? "${MR_NOT_SET:-true}" : "true");
    for (const Json* part : schema_.parts(*place.schema)) {
      for (const char* bound : {"minimum", "exclusiveMinimum", "maximum"})
        if (part->contains(bound)) {
          const double edge = part->at(bound), step = std::max(std::abs(edge), 1e-3) * 1e-6;
          for (const double v : {edge, edge - step, edge + step, edge - 1, edge + 1})
            out.push_back(v);
        }
      for (const Json& word : part->value("enum", Json::array())) {
        out.push_back(word);
        if (word.is_string()) out.push_back(word.get<std::string>() + "x");
        if (word.is_number())
          out.push_back(word.get<int>() - 1), out.push_back(word.get<int>() + 1);
      }
      if (now.is_array() && !now.empty())
        for (const char* bound : {"minItems", "maxItems"})
          for (const int more : {-1, 0, 1}) {
            if (!part->contains(bound) || part->at(bound).get<int>() + more < 0) continue;
            Json list = now;
            const std::size_t size = part->at(bound).get<int>() + more;
            while (list.size() > size) list.erase(list.size() - 1);
            while (list.size() < size) list.push_back(now[0]);
            out.push_back(std::move(list));
          }
    }
    return out;
  }

  test::TempDir dir_;
  JsonSchema schema_{Json::parse(text_of(MR_SOURCE_DIR "/schema/scene.schema.json"))};
  std::vector<Json> bases_;
};

TEST_F(SceneSchema, TheScenesOfThisTestAreValidAndHoldEveryKey) {
  std::set<const Json*> missing;
  all_keys(schema_.root(), missing);
  EXPECT_GT(missing.size(), 100u);
  for (const Json& base : bases_) {
    EXPECT_TRUE(schema_.accepts(base)) << base;
    for (const SceneProblem& problem : read(base).problems) ADD_FAILURE() << to_string(problem);
    for (const Place& place : places(base)) missing.erase(place.schema);
  }
  for (const Json* key : missing) ADD_FAILURE() << "in no scene of this test: " << key->dump(2);
}

TEST_F(SceneSchema, SchemaAndReaderAgreeOnEveryValue) {
  std::vector<std::string> found;
  std::size_t tried = 0;
  for (const Json& base : bases_)
    for (const Place& place : places(base))
      for (const Json& value : values_to_try(place, base.at(place.at))) {
        Json scene = base;
        scene[place.at] = value;
        ++tried;
        if (auto wrong =
                disagreement(scene, place.at.to_string() + " " + value.dump().substr(0, 60));
            !wrong.empty())
          found.push_back(std::move(wrong));
      }
  EXPECT_THAT(found, IsEmpty());
  EXPECT_GT(tried, 3000u);
}

TEST_F(SceneSchema, SchemaAndReaderAgreeOnMissingKeys) {
  std::vector<std::string> found;
  for (const Json& base : bases_)
    for (const Place& place : places(base)) {
      Json scene = base;
      Json& parent = scene[place.at.parent_pointer()];
      if (!parent.is_object()) continue;
      parent.erase(place.at.back());
      if (auto wrong = disagreement(scene, "without " + place.at.to_string()); !wrong.empty())
        found.push_back(std::move(wrong));
    }
  EXPECT_THAT(found, IsEmpty());
}

/// The words of a list that a message holds behind `lead` and before `end`: "a, b".
std::set<std::string> words_of(const std::vector<SceneProblem>& problems, const std::string& lead,
                               char end = '\0') {
  std::set<std::string> out;
  for (const SceneProblem& problem : problems) {
    const std::size_t at = problem.message.find(lead);
    if (at == std::string::npos) continue;
    const std::string tail = problem.message.substr(at + lead.size());
    std::istringstream list(tail.substr(0, tail.find(end)));
    for (std::string word; std::getline(list >> std::ws, word, ',');) out.insert(word);
  }
  return out;
}

// A key that the reader asks for and the schema lacks, or the other way round.
TEST_F(SceneSchema, TheReaderAsksForTheKeysOfTheSchema) {
  const std::string unknown(33, '?');  // too long to resemble another key
  std::map<const Json*, std::pair<std::set<std::string>, std::set<std::string>>> sets;
  for (const Json& base : bases_) {
    std::vector<Place> all = places(base);
    all.push_back({Json::json_pointer(), "", &schema_.root()});
    for (const Place& place : all) {
      if (!base.at(place.at).is_object() || place.key == "tcp") continue;  // names of nodes
      auto parts = schema_.parts(*place.schema);
      std::erase_if(parts,
                    [&](const Json* part) { return is_of_other_type(*part, base.at(place.at)); });
      const auto titled = std::find_if(parts.begin(), parts.end(),
                                       [](const Json* part) { return part->contains("title"); });
      auto& [by_reader, by_schema] = sets[titled == parts.end() ? place.schema : *titled];
      Json scene = base;
      scene[place.at][unknown] = 1;
      EXPECT_FALSE(schema_.accepts(scene)) << place.at;
      by_reader.merge(words_of(read(scene).problems, "known here: "));
      for (const Json* part : parts)
        if (part->contains("properties"))
          for (const auto& [name, inner] : (*part)["properties"].items())
            if (is_key(inner)) by_schema.insert(name);
    }
  }
  EXPECT_GT(sets.size(), 20u);
  for (const auto& [schema, keys] : sets)
    EXPECT_EQ(keys.first, keys.second) << "of the reader; of the schema: " << schema->dump(2);
}

// Every enumerated value is accepted by both the reader and the schema, or by neither.
TEST_F(SceneSchema, TheReaderTakesTheWordsOfTheSchema) {
  std::size_t compared = 0;
  for (const Json& base : bases_)
    for (const Place& place : places(base))
      for (const Json* part : schema_.parts(*place.schema)) {
        const Json words = part->value("enum", Json::array());
        if (words.empty() || !words[0].is_string()) continue;
        Json scene = base;
        scene[place.at] = "no such word";
        const auto problems = read(scene).problems;
        auto by_reader = words_of(problems, place.key + " must be one of ", ';');
        by_reader.merge(words_of(problems, "supported: "));  // the types of sources
        EXPECT_EQ(by_reader, (std::set<std::string>(words.begin(), words.end()))) << place.at;
        ++compared;
      }
  EXPECT_GT(compared, 10u);
}

TEST_F(SceneSchema, DefaultsAreWhatHoldsWithoutTheKey) {
  for (const Json& base : bases_)
    for (const Place& place : places(base)) {
      const Json& schema = *place.schema;
      Json without = base, with = base;
      if (!without[place.at.parent_pointer()].is_object()) continue;
      without[place.at.parent_pointer()].erase(place.at.back());
      with[place.at] = schema.value("default", Json::object());
      const bool is_plain_map = with[place.at].is_object() && base.at(place.at).is_object();
      if (!schema.contains("default") && (!is_plain_map || schema.contains("left_out"))) {
        EXPECT_TRUE(place.is_required || schema.contains("left_out"))
            << place.at << " has no default, is not required, and left_out says nothing";
        continue;
      }
      if (!schema_.accepts(without)) continue;  // required, or another key asks for it
      const SceneResult left_out = read(without), given = read(with);
      for (const auto* result : {&left_out, &given})
        for (const SceneProblem& problem : result->problems)
          ADD_FAILURE() << place.at << ": " << to_string(problem);
      EXPECT_EQ(left_out.scene, given.scene) << place.at << " " << with[place.at];
    }
}

/// How many notices name a key; none where the scene is refused.
std::optional<int> notices_of(const SceneResult& result, const std::string& key) {
  if (!result.problems.empty()) return std::nullopt;
  return static_cast<int>(
      std::count_if(result.notices.begin(), result.notices.end(), [&](const SceneProblem& notice) {
        return notice.message.starts_with(key + " ") || notice.message.starts_with(key + ":");
      }));
}

// Where not_acted_on is a sentence, scene_test.cpp has the cases.
TEST_F(SceneSchema, KeysThatAreNotActedOnAreNoticed) {
  int noticed = 0;
  for (const Place& place : places(bases_[0])) {
    const Json rule = place.schema->value("not_acted_on", Json(false));
    if (rule.is_string()) continue;
    std::string key = place.at.to_string().substr(1);
    std::replace(key.begin(), key.end(), '/', '.');
    for (const Json& value : values_to_try(place, bases_[0].at(place.at))) {
      Json scene = bases_[0];
      scene[place.at] = value;
      const auto notices = notices_of(read(scene), key);
      if (!notices || value.is_object()) continue;  // its notices are those of its keys
      const bool is_told = rule.is_array()
                               ? std::find(rule.begin(), rule.end(), value) != rule.end()
                               : rule == Json(true);
      EXPECT_EQ(*notices, is_told) << key << " " << value;
      noticed += is_told;
    }
  }
  EXPECT_GT(noticed, 2);
}

TEST_F(SceneSchema, AWrongTypeOfAnOptionIsOneProblem) {
  for (const Json& base : bases_)
    for (const Place& place : places(base)) {
      std::string option = place.at.to_string().substr(1);
      std::replace(option.begin(), option.end(), '/', '.');
      const bool is_list = base.at(place.at.parent_pointer()).is_array();
      if (is_list && !base.at(place.at).is_object()) continue;  // coordinates have no names
      option += base.at(place.at).is_structured() ? "=true" : "=[[]]";
      const auto problems = parse_scene(base.dump(), dir_ / "scene.yaml", {option}).problems;
      EXPECT_EQ(problems.size(), 1u) << option;
      for (const SceneProblem& problem : problems)
        EXPECT_TRUE(problems.size() == 1 && (problem.option || is_beyond_schema(problem)))
            << to_string(problem);
    }
}

TEST_F(SceneSchema, ExamplesAreValid) {
  std::size_t count = 0;
  for (const char* folder : {"/examples", "/examples/eval", "/bench/scenes"})
    for (const auto& entry :
         std::filesystem::directory_iterator(std::string(MR_SOURCE_DIR) + folder)) {
      if (entry.path().extension() != ".yaml") continue;
      ++count;
      const std::string text = text_of(entry.path());
      EXPECT_TRUE(schema_.accepts(json_of(text))) << entry.path();
      for (const SceneProblem& problem : load_scene(entry.path()).problems)
        EXPECT_TRUE(is_beyond_schema(problem)) << to_string(problem);
      const std::string to_schema =
          std::string(folder) == "/examples" ? "../schema" : "../../schema";
      EXPECT_TRUE(
          text.starts_with("# yaml-language-server: $schema=" + to_schema + "/scene.schema.json\n"))
          << entry.path() << " does not name the schema to editors";
    }
  EXPECT_GT(count, 15u);
}

// ------------------------------------------------------------------------------------- the page

std::string joined(const std::vector<std::string>& list, const char* between) {
  std::string out;
  for (const std::string& text : list) out += (out.empty() ? "" : between) + text;
  return out;
}

std::string bounds_text(const Json& part) {
  const auto text = [&](const char* key) { return part.contains(key) ? part[key].dump() : ""; };
  if (part.contains("exclusiveMinimum"))
    return "> " + text("exclusiveMinimum") + ", ≤ " + text("maximum");
  return text("minimum") + " … " + text("maximum");
}

/// The range of a key in words: its own, else from the keywords.
std::string range_text(const JsonSchema& schema, const Json& key) {
  const auto parts = schema.parts(key);
  for (const Json* part : parts)
    if (part->contains("range")) return (*part)["range"];
  for (const Json* part : parts)
    if (part->contains("title"))
      return "see [" + (*part)["title"].get<std::string>() + "](#" +
             (*part)["title"].get<std::string>() + ")";
  const auto has_type = [](const Json& part, const char* type) {
    const Json& given = part["type"];
    return given == type || (given.is_array() && given[0] == type);
  };
  for (const Json* part : parts) {
    if (part->contains("enum")) {
      std::vector<std::string> words;
      for (const Json& word : (*part)["enum"])
        words.push_back("`" + (word.is_string() ? word.get<std::string>() : word.dump()) + "`");
      return joined(words, ", ");
    }
    if (!part->contains("type")) continue;
    if (has_type(*part, "boolean")) return "`true`, `false`";
    if (has_type(*part, "number")) return bounds_text(*part);
    if (has_type(*part, "integer")) return bounds_text(*part) + ", whole";
    if (has_type(*part, "object")) return "the keys below";
    if (has_type(*part, "array")) {
      const std::string least = (*part)["minItems"].dump(), most = (*part)["maxItems"].dump();
      const std::string count = least == most ? least : least + " … " + most;
      const bool is_numbers = part->at("items").contains("maximum");
      return count + (is_numbers ? " numbers, each " : ", ") + range_text(schema, (*part)["items"]);
    }
  }
  return "";
}

std::string default_text(const Json& key, bool is_required) {
  if (is_required) return "required";
  if (key.contains("left_out")) return key["left_out"];
  if (!key.contains("default")) return "as of its keys";
  const Json& value = key["default"];
  return "`" + (value.is_string() ? value.get<std::string>() : value.dump()) + "`";
}

std::string effect_text(const Json& key) {
  std::string out = key["description"];
  const Json rule = key.value("not_acted_on", Json(false));
  if (rule == Json(false)) return out;
  if (rule.is_string()) return out + " **Not acted on** " + rule.get<std::string>() + ".";
  std::vector<std::string> words;
  if (rule.is_array())
    for (const Json& word : rule) words.push_back("`" + word.get<std::string>() + "`");
  return out + " **Not acted on yet**" + (words.empty() ? "" : ": " + joined(words, ", ")) + ".";
}

/// The rows of a mapping's keys; what has a title has a table of its own.
std::string rows(const JsonSchema& schema, const Json& map, const std::string& before) {
  std::string out;
  for (const Json* part : schema.parts(map)) {
    if (!part->contains("properties")) continue;
    const Json required = part->value("required", Json::array());
    for (const auto& [name, key] : (*part)["properties"].items()) {
      if (!is_key(key)) continue;
      const bool is_required = std::find(required.begin(), required.end(), name) != required.end();
      out += "| `" + before + name + "` | " + key.value("unit", std::string()) + " | " +
             default_text(key, is_required) + " | " + range_text(schema, key) + " | " +
             effect_text(key) + " |\n";
      const auto inner = schema.parts(key);
      const bool has_table = std::any_of(inner.begin(), inner.end(),
                                         [](const Json* p) { return p->contains("title"); });
      if (!has_table) out += rows(schema, key, before + name + ".");
    }
  }
  return out;
}

void tables(const JsonSchema& schema, const Json& at, std::map<std::string, std::string>& out) {
  if (!at.is_structured()) return;
  if (at.is_object() && at.contains("title") && at.contains("properties"))
    out[at["title"]] =
        "| key | unit | default | range | effect |\n|---|---|---|---|---|\n" + rows(schema, at, "");
  for (const auto& [name, inner] : at.items()) tables(schema, inner, out);
}

TEST_F(SceneSchema, ThePageHasTheTablesOfTheSchema) {
  const std::filesystem::path page = MR_SOURCE_DIR "/docs/scene-file.md";
  const std::string before = text_of(page);
  std::string text = before;
  std::map<std::string, std::string> of_schema;
  tables(schema_, schema_.root(), of_schema);
  EXPECT_GT(of_schema.size(), 10u);
  for (const auto& [title, table] : of_schema) {
    const std::string open = "<!-- keys of " + title + ", from schema/scene.schema.json -->\n";
    const std::size_t at = text.find(open), end = text.find("<!-- end -->", at);
    if (at == std::string::npos || end == std::string::npos) {
      ADD_FAILURE() << "docs/scene-file.md has no place for the keys of " << title << ":\n" << open;
      continue;
    }
    text.replace(at + open.size(), end - at - open.size(), table);
  }
  if (std::getenv("MR_WRITE_DOCS"))
    ASSERT_TRUE(write_file(page, text));
  else
    EXPECT_EQ(before, text) << "the schema says otherwise: MR_WRITE_DOCS=1 build/dev/bin/"
                               "scene_schema_test writes the tables anew";
}

}  // namespace
}  // namespace mr
