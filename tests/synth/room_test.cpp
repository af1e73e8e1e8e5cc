#include "mr/synth/room.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "mr/core/parallel.h"

namespace mr::synth {
namespace {

RigConfig small_rig() {
  RigConfig rig;
  rig.depth_width = 320, rig.depth_height = 288;
  rig.color_width = 320, rig.color_height = 180;
  rig.frames = 2;
  return rig;
}

/// The default room, made once for all tests.
std::shared_ptr<const Room> shared_room() {
  static const auto room = std::make_shared<const Room>(make_room(RigConfig{}));
  return room;
}

Frame frame_of(FrameSource& source) {
  auto frame = source.next();
  return frame.ok() && *frame ? **frame : Frame{};
}

std::unique_ptr<FrameSource> open_one(const RigConfig& rig, const SensorConfig& sensor) {
  const SensorId wanted[] = {SensorId{0}};
  return std::move(open_rig(rig, {&sensor, 1}, wanted, 30, {}).front());
}

Frame first_frame(const RigConfig& rig, const SensorConfig& sensor) {
  return frame_of(*open_one(rig, sensor));
}

TEST(Room, IsAWellFormedMesh) {
  const Room& room = *shared_room();
  const std::size_t triangles = room.mesh.triangles.size(), vertices = room.mesh.positions.size();
  ASSERT_GT(triangles, 50'000u);
  EXPECT_EQ(room.albedo.size(), triangles);
  EXPECT_EQ(room.material.size(), triangles);
  EXPECT_EQ(room.surface.size(), triangles);
  EXPECT_EQ(room.light.size(), vertices);
  EXPECT_EQ(room.surface_m.size(), vertices);
  const Pose T_room_world = room.T_world_room.inverse();
  for (const Vec3f p : room.mesh.positions) {
    const Vec3d q = T_room_world * vec_cast<double>(p);
    ASSERT_TRUE(std::abs(q.x) < 3.02 && std::abs(q.y) < 2.52 && q.z > -0.02 && q.z < 3.02);
  }
  EXPECT_GT(room.blocks.size(), 50u);
  for (const Vec3f light : room.light)
    ASSERT_TRUE(is_finite(light) && light.x >= 0 && light.y >= 0 && light.z >= 0);
  for (std::size_t t = 0; t < triangles; ++t) {
    ASSERT_GT(length(room.mesh.area_normal(t)), 0);
    ASSERT_LT(room.material[t], room.materials.size());
  }
}

TEST(Room, SameSeedSameBytesOnAnyNumberOfThreads) {
  const RigConfig rig = small_rig();
  const std::vector<SensorConfig> sensors = rig_sensors(rig);
  std::vector<Room> rooms;
  std::vector<Frame> frames;
  for (const int threads : {1, 8})
    Arena(threads).run([&] {
      rooms.push_back(make_room(rig));
      const SensorId wanted[] = {SensorId{1}};
      const auto source = std::move(open_rig(rig, sensors, wanted, 30, {}).front());
      for (int i = 0; i < 2; ++i) frames.push_back(frame_of(*source));
      EXPECT_FALSE(*source->next());
    });
  EXPECT_EQ(rooms[0].mesh, rooms[1].mesh);
  EXPECT_EQ(rooms[0].light, rooms[1].light);
  for (const int i : {0, 1}) {
    EXPECT_EQ(frames[i].depth, frames[i + 2].depth);
    EXPECT_EQ(frames[i].color, frames[i + 2].color);
  }
  EXPECT_EQ(frames[0].color, frames[1].color);
  EXPECT_NE(frames[0].depth, frames[1].depth);  // the noise is new in every frame
  EXPECT_EQ(frames[1].index, 1u);
  EXPECT_EQ(frames[1].sensor, SensorId{1});
}

TEST(Room, AnotherSeedIsAnotherRoom) {
  RigConfig rig = small_rig();
  rig.seed = 2;
  EXPECT_NE(build_room(rig).mesh, shared_room()->mesh);
}

TEST(Room, PureDepthAgreesWithTheDistanceToFloorAndWalls) {
  RigConfig rig = small_rig();
  rig.noise = false;
  rig.sensors = 2;
  const std::vector<SensorConfig> sensors = rig_sensors(rig);
  const SensorId both[] = {SensorId{0}, SensorId{1}};
  const auto sources = open_rig(rig, sensors, both, 30, {});
  for (std::size_t i = 0; i < std::size(both); ++i) {
    const SensorConfig& sensor = sensors[i];
    const Frame frame = frame_of(*sources[i]);
    // In the room's frame the empty room is a box: the exit of each ray is known.
    const Pose T_room_depth = shared_room()->T_world_room.inverse() * sensor.T_world_depth[0];
    const Vec3d eye = T_room_depth.translation, low{-3, -2.5, 0}, high{3, 2.5, 3};
    int on_shell = 0, in_range = 0;
    for (int y = 0; y < frame.depth.height; ++y)
      for (int x = 0; x < frame.depth.width; ++x) {
        const Vec3d ray =
            T_room_depth.rotation * unproject(sensor.depth_camera, {double(x), double(y)});
        double exit = 1e9;
        for (int axis = 0; axis < 3; ++axis)
          if (ray[axis] != 0)
            exit = std::min(exit, ((ray[axis] > 0 ? high : low)[axis] - eye[axis]) / ray[axis]);
        const double z = *frame.depth.at(x, y);
        if (exit > sensor.depth_far_m) continue;
        ++in_range;
        ASSERT_LT(z, exit + 6e-4);
        ASSERT_GT(z, 0) << x << "," << y;  // the room has no holes
        on_shell += std::abs(z - exit) < 6e-4;
      }
    EXPECT_GT(on_shell, in_range / 4);
  }
}

TEST(Room, AllKindsSizesAndDetailsCanBeBuilt) {
  using Kind = RigConfig::Kind;
  RigConfig rig = small_rig();
  for (const Kind kind :
       {Kind::room, Kind::conference, Kind::office, Kind::corridor, Kind::hallway})
    for (const Vec3d size : {usual_room_m(kind), Vec3d{3, 3.3, 2.2}, Vec3d{6, 9, 3.5}}) {
      rig.kind = kind, rig.room_m = size, rig.detail = size.x == 3 ? 1 : 0;
      EXPECT_FALSE(build_room(rig).mesh.empty());
    }
}

/// Letters as a reader knows them, drawn independently of the room's own font.
constexpr const char* kLetterR[] = {"1111.", "1...1", "1...1", "1111.", "1.1..", "1..1.", "1...1"};
constexpr const char* kLetterE[] = {"11111", "1....", "1....", "1111.", "1....", "1....", "11111"};

TEST(Room, ThePosterCanBeReadFromInside) {
  RigConfig rig;
  const auto sensor = rig_sensors(rig)[0];
  const Frame frame = first_frame(rig, sensor);
  const Camera& camera = *sensor.color_camera;
  const Pose T_color_room =
      sensor.T_color_depth * sensor.T_world_depth[0].inverse() * shared_room()->T_world_room;
  // On the wall +x, centred at y = 0, z = 1.95; from inside, -y is to the right. Ten letters of 6
  // columns each less the last gap, 84 % of 1.7 m wide.
  constexpr double kPixel = 0.84 * 1.7 / 59, kFront = 3 - 0.025;
  const auto ink = [&](double column, double row) {
    const Vec3d p_room{kFront, -(column + 0.5 - 29.5) * kPixel, 1.95 - (row + 0.5 - 3.5) * kPixel};
    const auto pixel = project(camera, T_color_room * p_room);
    if (!pixel) return 0;
    return 255 - frame.color.at(static_cast<int>(std::lround(pixel->x)),
                                static_cast<int>(std::lround(pixel->y)))[1];
  };
  const auto agrees = [&](int letter, const char* const* glyph) {
    int right = 0;
    for (int row = 0; row < 7; ++row)
      for (int column = 0; column < 5; ++column)
        right += (ink(letter * 6 + column, row) > 110) == (glyph[row][column] == '1');
    return right;
  };
  for (const int place : {1, 5, 9}) EXPECT_GE(agrees(place, kLetterE), 33) << place;  // mEshrEducE
  EXPECT_GE(agrees(4, kLetterR), 33);
  EXPECT_LT(agrees(3, kLetterE), 30);  // an H is no E
}

TEST(Texture, LettersRunToTheRightAndStandUpright) {
  Material m;
  m.pattern = Pattern::text;
  m.text = "L";
  m.size_m = {0.5f, 0.7f};
  m.color = {1, 1, 1}, m.accent = {0, 0, 0};
  const auto dark = [&](float x, float y) { return paint(m, {x, y}, 0).x < 0.5f; };
  EXPECT_TRUE(dark(0.08f, 0.55f));  // the stem, on the left
  EXPECT_FALSE(dark(0.42f, 0.55f));
  EXPECT_TRUE(dark(0.42f, 0.12f));  // the foot, at the bottom
}

}  // namespace
}  // namespace mr::synth
