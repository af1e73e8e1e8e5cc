#include "merge_case.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <numeric>
#include <optional>
#include <stdexcept>

#include "bytes.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/merge/islands.h"
#include "mr/node/sensor_node.h"
#include "mr/node/sources.h"
#include "mr/sensor/rgbd_images.h"
#include "mr/simplify/simplify.h"
#include "mr/synth/room.h"
#include "mr/synth/truth.h"
#include "scene_input.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

const std::string kRoomBench = "room_bench", kRooms = "rooms/", kOneRoom = "one_room/";
constexpr std::array<std::uint32_t, 5> kSensors{1, 5, 20, 100, 400};
constexpr std::uint32_t kSensorsOfARoom = 20, kRoomsMade = 3;
constexpr std::size_t kTrianglesOfASensor = 10'000;
constexpr auto kPatience = std::chrono::hours(2);  // 400 pictures, where none is in the cache yet

// ------------------------------------------------------------ scenes

std::filesystem::path bench_file(const char* name, int sensor, const char* type) {
  return data_folder() / kRoomBench / fmt::format("{}_{}.{}", name, sensor, type);
}

Pose pose_from_file(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::array<double, 16> matrix{};
  for (double& value : matrix)
    if (!(in >> value)) throw std::runtime_error(file.string() + ": not 16 numbers");
  const auto pose = pose_from_matrix(matrix);
  if (!pose) throw std::runtime_error(file.string() + ": " + pose.error().message);
  return *pose;
}

/// Four simulated Kinect-like sensors (640x576) in one furnished room of 6x5x3 m, as a sensor node
/// takes them.
Scene room_bench_scene() {
  Scene scene;
  scene.id = kRoomBench;
  for (int i = 0; i < 4; ++i) {
    SensorConfig sensor;
    sensor.id = fmt::format("cam-{}", i);
    sensor.source = sensor::RgbdImagesSource{
        .color = {}, .depth = {bench_file("depth", i, "png")}, .invalid = {0, 65535}};
    sensor.depth_camera.width = 640, sensor.depth_camera.height = 576;
    sensor.depth_camera.fx = sensor.depth_camera.fy = 504;
    sensor.depth_camera.cx = 320, sensor.depth_camera.cy = 288;
    sensor.T_world_depth = {pose_from_file(bench_file("pose", i, "txt"))};
    scene.sensors.push_back(std::move(sensor));
  }
  return scene;
}

/// A rig of sensors with small depth pictures, whose poses are 3 mm off.
Scene rig_scene(const RigConfig& room) {
  RigConfig rig = room;
  rig.depth_width = 320, rig.depth_height = 288;  // nfov_binned
  rig.color_width = 64, rig.color_height = 36;    // of no use here
  rig.calib_error_mm = 3;
  rig.frames = 1;
  Scene scene;
  scene.id = "rig";
  scene.rig = rig;
  scene.sensors = synth::rig_sensors(rig);
  return scene;
}

RigConfig room_of_20(std::uint32_t seed) {
  RigConfig rig;
  rig.seed = seed, rig.sensors = kSensorsOfARoom;
  return rig;
}

RigConfig one_large_room() {
  RigConfig rig;
  rig.room_m = {6, 9, 3}, rig.sensors = kSensors.back();
  return rig;
}

// ------------------------------------------------------------ what takes threads: in a child

Message part_message(const kit::Part& part) {
  const SourceInfo& source = part.sources.at(0);
  const Camera& k = source.depth_camera;
  Message out = to_message(part.mesh);
  out["sensor"] = number_of(source.sensor);
  out["size"] = {k.width, k.height};
  out["numbers"] = binary(std::vector<double>{k.fx, k.fy, k.cx, k.cy, source.precision.base_m,
                                              source.precision.per_m2, part.error_m});
  out["pose"] = binary(std::vector<Pose>{source.T_world_depth});
  return out;
}

kit::Part part_from(const Message& message) {
  kit::Part out;
  out.mesh = mesh_from(message);
  const auto n = array_from<double>(message.at("numbers"));
  SourceInfo source;
  source.sensor = SensorId{message.at("sensor").get<std::uint32_t>()};
  source.depth_camera.width = message.at("size").at(0);
  source.depth_camera.height = message.at("size").at(1);
  source.depth_camera.fx = n.at(0), source.depth_camera.fy = n.at(1);
  source.depth_camera.cx = n.at(2), source.depth_camera.cy = n.at(3);
  source.precision = {n.at(4), n.at(5)};
  source.T_world_depth = array_from<Pose>(message.at("pose")).at(0);
  out.error_m = static_cast<float>(n.at(6));
  out.sources = {source};
  return out;
}

/// As a sensor node makes it; with `triangles`, of about so many.
kit::Part part_of(const Scene& scene, SensorId sensor, Frame frame, std::size_t triangles) {
  node::SensorNode node(scene, sensor);
  auto made = node.reconstruct(std::move(frame));
  if (!made) throw std::runtime_error(made.error().message);
  kit::Part out{std::move(made->mesh), made->errors.most_m(), {}};
  if (triangles > 0) {
    auto small = simplify::simplify(out.mesh, {.triangles = triangles});
    if (!small) throw std::runtime_error(small.error().message);
    out.error_m += small->error_m;
    out.mesh = merge::remove_islands(small->mesh, merge::island_area_m2(scene.voxel_m));
  }
  out.mesh = kit::weld(out.mesh);
  clear_labels(out.mesh);
  SourceInfo source;
  source.sensor = sensor;
  source.depth_camera = undistorted(scene.sensor(sensor).depth_camera);
  source.T_world_depth = made->frame.T_world_depth;
  source.precision = scene.sensor(sensor).precision;
  out.sources = {source};
  return out;
}

/// The parts of some sensors' first frames.
Message parts_of(const Scene& scene, const std::vector<SensorId>& wanted, std::size_t triangles) {
  cli::ProgressBar bar;
  Message out = Message::array();
  Arena arena(0);
  arena.run([&] {
    const auto sources =
        node::open_sources(scene, wanted, synth::default_rig_cache(),
                           [&](int done, int of) { bar.show("rendering", done, of); });
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      bar.show("reconstructing", i, wanted.size());
      auto frame = sources[i]->next();
      if (!frame || !*frame)
        throw std::runtime_error(frame ? "a sensor has no frame" : frame.error().message);
      if (scene.sensor(wanted[i]).depth_camera.model != CameraModel::pinhole)
        throw std::runtime_error("sensor '" + scene.sensor(wanted[i]).id +
                                 "' is no pinhole camera");
      out.push_back(part_message(part_of(scene, wanted[i], **std::move(frame), triangles)));
    }
  });
  return out;
}

std::vector<SensorId> first(std::size_t count) {
  std::vector<SensorId> out;
  for (std::size_t i = 0; i < count; ++i) out.push_back(sensor_at(i));
  return out;
}

using Parts = Result<std::vector<kit::Part>>;

Parts load_parts(const std::function<Message()>& make) {
  const auto outcome = apart(make, kPatience);
  if (!outcome) return outcome.error();
  std::vector<kit::Part> out;
  for (const Message& part : *outcome) out.push_back(part_from(part));
  return out;
}

Result<Mesh> load_truth(const RigConfig& rig) {
  const auto outcome = apart([&] {
    Message out;
    Arena arena(0);
    arena.run([&] { out = to_message(synth::Truth(rig, Scene{}.fps).surface(0).mesh); });
    return out;
  });
  if (!outcome) return outcome.error();
  return mesh_from(*outcome);
}

// ------------------------------------------------------------ rooms

void move_by(Vec3d by, kit::Part& part) {
  for (Vec3f& p : part.mesh.positions) p = p + vec_cast<float>(by);
  for (SourceInfo& source : part.sources)
    source.T_world_depth.translation = source.T_world_depth.translation + by;
}

/// How rooms lie in the world. In a child, because building one takes threads.
Result<Mat3> turn_of_rooms() {
  const auto outcome = apart(
      [] { return binary(std::vector<Pose>{synth::build_room(room_of_20(1)).T_world_room}); });
  if (!outcome) return outcome.error();
  return array_from<Pose>(*outcome).at(0).rotation;
}

/// Where room number `i` of a building stands: walls of neighbours are half a metre apart.
Vec3d place_of_room(std::size_t i, const Mat3& turn) {
  constexpr std::size_t kRoomsInARow = 5;
  const Vec3d room_m = room_of_20(1).room_m;
  const double x = static_cast<double>(i % kRoomsInARow), y = static_cast<double>(i / kRoomsInARow);
  return turn * Vec3d{x * (room_m.x + 0.5), y * (room_m.y + 0.5), 0};
}

/// `sensors` of them in rooms of 20; three rooms are rendered, the others are copies of theirs.
Parts load_rooms(std::uint32_t sensors) {
  const auto turn = turn_of_rooms();
  if (!turn) return turn.error();
  std::vector<kit::Part> out;
  std::vector<std::vector<kit::Part>> made;
  const std::uint32_t rooms = (sensors + kSensorsOfARoom - 1) / kSensorsOfARoom;
  for (std::uint32_t room = 0; room < rooms; ++room) {
    if (room < kRoomsMade) {
      auto parts = load_parts([&] {
        return parts_of(rig_scene(room_of_20(room + 1)), first(std::min(sensors, kSensorsOfARoom)),
                        kTrianglesOfASensor);
      });
      if (!parts) return parts.error();
      made.push_back(*std::move(parts));
    }
    for (kit::Part part : made[room % kRoomsMade]) {
      move_by(place_of_room(room, *turn), part);
      SensorId& sensor = part.sources[0].sensor;
      sensor = SensorId{number_of(sensor) + room * kSensorsOfARoom};
      out.push_back(std::move(part));
    }
  }
  return out;
}

Vec3f middle_of(const kit::Part& part) {
  Vec3f sum;
  for (const Vec3f p : part.mesh.positions) sum += p;
  return sum / static_cast<float>(std::max<std::size_t>(part.mesh.positions.size(), 1));
}

/// Sorts sensors in strips across the room and along each strip, so that groups of 20 consecutive
/// ones have similar views.
void put_neighbours_together(std::vector<kit::Part>& parts) {
  const double groups = static_cast<double>(parts.size()) / kSensorsOfARoom;
  const auto strips = static_cast<std::size_t>(std::max(1.0, std::round(std::sqrt(groups))));
  const std::size_t strip = (parts.size() + strips - 1) / strips;
  const auto by = [](float Vec3f::*axis) {
    return [axis](const kit::Part& a, const kit::Part& b) {
      return middle_of(a).*axis < middle_of(b).*axis;
    };
  };
  std::ranges::stable_sort(parts, by(&Vec3f::y));
  for (std::size_t at = 0; at < parts.size(); at += strip)
    std::stable_sort(parts.begin() + at, parts.begin() + std::min(at + strip, parts.size()),
                     by(&Vec3f::x));
}

/// Every so many of 400 sensors in a room of 6x9 m.
Parts load_one_room(std::uint32_t sensors) {
  std::vector<SensorId> wanted;
  for (std::uint32_t i = 0; i < sensors; ++i)
    wanted.push_back(SensorId{i * kSensors.back() / sensors});
  auto parts = load_parts(
      [&] { return parts_of(rig_scene(one_large_room()), wanted, kTrianglesOfASensor); });
  if (parts) put_neighbours_together(*parts);
  return parts;
}

/// The number after a prefix that is one of the cases'.
std::optional<std::uint32_t> sensors_in(const std::string& name, const std::string& prefix) {
  for (const std::uint32_t sensors : kSensors)
    if (name == prefix + std::to_string(sensors)) return sensors;
  return std::nullopt;
}

std::vector<std::size_t> groups_of_20(std::size_t parts) {
  std::vector<std::size_t> out;
  for (std::size_t left = parts; left > 0; left -= out.back())
    out.push_back(std::min<std::size_t>(left, kSensorsOfARoom));
  return out;
}

/// Sets `out.parts` and what goes with them.
Status load_into(MergeCase& out) {
  const auto rooms = sensors_in(out.name, kRooms), one_room = sensors_in(out.name, kOneRoom);
  auto parts = rooms      ? load_rooms(*rooms)
               : one_room ? load_one_room(*one_room)
                          : load_room_bench(kTrianglesOfABench);
  if (!parts) return parts.error();
  out.parts = *std::move(parts);
  out.groups = groups_of_20(out.parts.size());
  out.of_scale = rooms || one_room;
  if (!rooms || *rooms > kSensorsOfARoom) return {};
  auto truth = load_truth(*rig_scene(room_of_20(1)).rig);
  if (!truth) return truth.error();
  out.truth = *std::move(truth);
  return {};
}

}  // namespace

std::vector<CaseInfo> merge_cases() {
  std::vector<CaseInfo> out{
      {kRoomBench, "four sensors in a furnished room, 10 %", true, no_room_bench()}};
  for (const std::uint32_t n : kSensors)
    out.push_back({kRooms + std::to_string(n), fmt::format("{} sensors, 20 a room", n), true, {}});
  for (const std::uint32_t n : kSensors)
    out.push_back(
        {kOneRoom + std::to_string(n), fmt::format("{} sensors in a room of 6x9 m", n), false, {}});
  return out;
}

Result<MergeCase> load_merge_case(const std::string& name) {
  MergeCase out;
  out.name = name;
  if (const Status loaded = load_into(out); !loaded) return loaded.error();
  return out;
}

Result<MergeCase> load_merge_scene(const std::filesystem::path& scene_file) {
  MergeCase out;
  out.name = scene_file.stem().string();
  const Scene stated = load_scene(scene_file).scene;  // the child reports its problems
  out.voxel_m = stated.voxel_m, out.config = stated.merge;
  auto parts = load_parts([&] {
    const Scene scene = load_or_throw(scene_file);
    return parts_of(scene, first(scene.sensors.size()), 0);
  });
  if (!parts) return parts.error();
  out.parts = *std::move(parts);
  out.groups = {out.parts.size()};
  return out;
}

Result<std::vector<kit::Part>> load_room_bench(std::size_t triangles) {
  return load_parts([&] { return parts_of(room_bench_scene(), first(4), triangles); });
}

std::string no_room_bench() {
  const auto file = bench_file("depth", 3, "png");
  return std::filesystem::exists(file) ? "" : "no " + file.string() + " (set MR_DATA)";
}

double megabytes(const std::vector<kit::Part>& parts) {
  double bytes = 0;
  for (const kit::Part& part : parts)
    bytes += static_cast<double>(part.mesh.positions.size() * sizeof(Vec3f) +
                                 part.mesh.triangles.size() * sizeof(Triangle));
  return bytes / 1e6;
}

}  // namespace mr::bench
