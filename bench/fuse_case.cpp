#include "fuse_case.h"

#include <fmt/format.h>

#include <array>
#include <fstream>
#include <stdexcept>

#include "bytes.h"
#include "mr/fusion/fusion_config.h"
#include "mr/kit/image_io.h"
#include "mr/node/capture.h"
#include "mr/synth/room.h"
#include "mr/synth/truth.h"
#include "scene_input.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

constexpr double kLimit_m = 5;
constexpr double kTruthFps = 30;

/// A frame in files: 16-bit millimetres and a pose.
struct Recording {
  std::string name, what;
  std::filesystem::path depth, pose;  ///< below the data folder
  Camera camera;
  bool by_default = true;
};

Camera pinhole(int width, int height, double focal_px, double cx, double cy) {
  Camera camera;
  camera.width = width, camera.height = height;
  camera.fx = camera.fy = focal_px;
  camera.cx = cx, camera.cy = cy;
  return camera;
}

Recording kitchen(int frame) {
  const std::string stem = fmt::format("sevenscenes_redkitchen/frame-{:06}", frame);
  const bool first = frame == 300;
  return {first ? "kitchen" : fmt::format("kitchen-{}", frame),
          fmt::format("7-Scenes red kitchen, frame {}", frame),
          stem + ".depth.png",
          stem + ".pose.txt",
          pinhole(640, 480, 585, 320, 240),
          first};
}

const std::vector<Recording>& recordings() {
  static const auto all = [] {
    std::vector<Recording> out{{"room_bench", "a furnished 6x5x3 m room", "room_bench/depth_0.png",
                                "room_bench/pose_0.txt", pinhole(640, 576, 504, 320, 288)}};
    for (const int frame : {300, 890, 200, 30, 430, 120, 460, 170}) out.push_back(kitchen(frame));
    return out;
  }();
  return all;
}

const std::string kRig = "rig";

Result<Pose> read_pose(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::array<double, 16> matrix{};
  for (double& value : matrix)
    if (!(in >> value)) return Error{Error::Cause::corrupt, file.string() + ": not 16 numbers"};
  auto pose = pose_from_matrix(matrix);
  if (!pose) return Error{pose.error().cause, file.string() + ": " + pose.error().message};
  return pose;
}

Result<FuseCase> read_recording(const Recording& recording) {
  const std::filesystem::path folder = data_folder();
  const auto counts = kit::read_depth16(folder / recording.depth);
  if (!counts) return counts.error();
  auto pose = read_pose(folder / recording.pose);
  if (!pose) return pose.error();
  const Camera& camera = recording.camera;
  if (counts->width != camera.width || counts->height != camera.height)
    return Error{Error::Cause::invalid, (folder / recording.depth).string() + ": not " +
                                            fmt::format("{}x{}", camera.width, camera.height)};
  FuseCase out;
  out.name = recording.name;
  out.depth = ImageDepth(camera.width, camera.height);
  out.camera = camera;
  out.T_world_camera = *pose;
  out.limit_m = kLimit_m;
  for (std::size_t i = 0; i < counts->data.size(); ++i)
    if (const double metres = counts->data[i] * 0.001; metres <= kLimit_m)  // 65535 is beyond
      out.depth.data[i] = static_cast<float>(metres);
  return out;
}

// ------------------------------------------------------------ what takes threads: in a child

Message case_message(const FuseCase& c) {
  const Camera& k = c.camera;
  return {{"name", c.name},
          {"size", {k.width, k.height}},
          {"intrinsics", binary(std::vector<double>{k.fx, k.fy, k.cx, k.cy})},
          {"beams", binary(k.beam_altitude_rad)},
          {"pose", binary(std::vector<Pose>{c.T_world_camera})},
          {"lengths", binary(std::vector<double>{c.voxel_m, c.truncation_m, c.limit_m})},
          {"depth", binary(c.depth.data)},
          {"truth", to_message(c.truth)}};
}

FuseCase case_from(const Message& message) {
  FuseCase out;
  out.name = message.at("name");
  out.depth.width = out.camera.width = message.at("size").at(0);
  out.depth.height = out.camera.height = message.at("size").at(1);
  const auto k = array_from<double>(message.at("intrinsics"));
  out.camera.fx = k.at(0), out.camera.fy = k.at(1), out.camera.cx = k.at(2),
  out.camera.cy = k.at(3);
  out.camera.beam_altitude_rad = array_from<double>(message.at("beams"));
  if (!out.camera.beam_altitude_rad.empty()) {
    out.camera.model = CameraModel::lidar;
    out.camera.beam_azimuth_rad.assign(out.camera.beam_altitude_rad.size(), 0);
  }
  out.T_world_camera = array_from<Pose>(message.at("pose")).at(0);
  const auto lengths = array_from<double>(message.at("lengths"));
  out.voxel_m = lengths.at(0), out.truncation_m = lengths.at(1), out.limit_m = lengths.at(2);
  const auto depth = array_from<float>(message.at("depth"));
  out.depth.data.assign(depth.begin(), depth.end());
  out.truth = mesh_from(message.at("truth"));
  return out;
}

/// The first sensor of a rig, with its noise and the truth.
FuseCase render(const RigConfig& rig, const std::string& name, double limit_m) {
  const auto sensors = synth::rig_sensors(rig);
  const auto sources = synth::open_rig(rig, sensors, std::array{SensorId{0}}, kTruthFps, {});
  auto frame = sources.at(0)->next();
  if (!frame) throw std::runtime_error(frame.error().message);
  FuseCase out;
  out.name = name;
  out.camera = sensors[0].depth_camera;
  out.depth = std::move((*frame)->depth);
  out.T_world_camera = (*frame)->T_world_depth;
  out.limit_m = limit_m;
  for (float& depth_m : out.depth.data)
    if (depth_m > limit_m) depth_m = 0;
  out.truth = synth::Truth(rig, kTruthFps).surface(0).mesh;
  return out;
}

Message read_scene(const std::filesystem::path& file) {
  const Scene scene = load_or_throw(file);
  node::CaptureReader reader(scene, synth::default_rig_cache());
  const auto frames = reader.next(
      [](SensorId, const Error& lost) { fmt::print(stderr, "dropped: {}\n", lost.message); });
  if (!frames || frames->empty())
    throw std::runtime_error(file.string() + ": no sensor has a first frame");
  Message out = Message::array();
  for (const Frame& frame : *frames) {
    const SensorConfig& sensor = scene.sensor(frame.sensor);
    if (sensor.depth_camera.model != CameraModel::pinhole)
      throw std::runtime_error("sensor '" + sensor.id + "' is no pinhole camera");
    FuseCase fuse;
    fuse.name = sensor.id;
    fuse.depth = frame.depth;
    fuse.camera = undistorted(sensor.depth_camera);
    fuse.T_world_camera = frame.T_world_depth;
    fuse.voxel_m = scene.voxel_m;
    fuse.truncation_m = scene.fusion.truncation_m;
    fuse.limit_m = sensor.depth_far_m;
    out.push_back(case_message(fuse));
  }
  return out;
}

}  // namespace

std::vector<CaseInfo> fuse_cases() {
  std::vector<CaseInfo> out;
  for (const Recording& recording : recordings()) {
    const auto file = data_folder() / recording.depth;
    const bool there = std::filesystem::exists(file);
    out.push_back({recording.name, recording.what, recording.by_default,
                   there ? "" : "no " + file.string() + " (set MR_DATA)"});
  }
  out.push_back({kRig, "one Kinect of the synthetic room, with its truth", true, ""});
  return out;
}

Result<FuseCase> load_fuse_case(const std::string& name) {
  for (const Recording& recording : recordings())
    if (recording.name == name) return read_recording(recording);
  const auto rig = apart([] { return case_message(render({}, kRig, kLimit_m)); });
  if (!rig) return rig.error();
  return case_from(*rig);
}

Result<FuseCase> load_scan_case(const std::string& name, double voxel_m) {
  constexpr double kScanLimit_m = 20;
  RigConfig rig;
  rig.seed = 2, rig.room_m = {8, 5, 3}, rig.sensors = 0, rig.lidars = 1;
  const auto message = apart([&] { return case_message(render(rig, name, kScanLimit_m)); });
  if (!message) return message.error();
  FuseCase out = case_from(*message);
  out.voxel_m = voxel_m;
  out.truncation_m = fusion::FusionConfig::kTruncation_voxels * voxel_m;
  return out;
}

Result<std::vector<FuseCase>> load_fuse_scene(const std::filesystem::path& scene_file) {
  const auto outcome = apart([&] { return read_scene(scene_file); });
  if (!outcome) return outcome.error();
  std::vector<FuseCase> out;
  for (const Message& one : *outcome) out.push_back(case_from(one));
  return out;
}

}  // namespace mr::bench
