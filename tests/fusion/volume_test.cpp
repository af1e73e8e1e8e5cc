// The distances themselves: against the definition, worked out densely in double precision, and
// what several frames make of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "mr/fusion/fuse.h"
#include "support/depth_pictures.h"

namespace mr {
namespace {

using fusion::DepthEdges;
using fusion::DepthFrame;
using fusion::History;
using fusion::VolumeConfig;
using fusion::VoxelVolume;

VolumeConfig voxels(double voxel_m, double truncation_m, History history) {
  VolumeConfig config;
  config.voxel_m = voxel_m, config.truncation_m = truncation_m, config.history = history;
  return config;
}

Mesh surface_of(const VolumeConfig& config, const DepthFrame& frame, DepthEdges edges) {
  VoxelVolume volume(config);
  volume.integrate(frame);
  return fusion::extract_surface(volume, edges);
}

// --- the definition, without blocks, bits and rows

/// One frame's observation of a voxel: projective distance to the nearest pixel's depth, in voxels.
struct Sample {
  bool seen = false;
  bool unsure = false;  ///< so near a pixel's border or the band's end that rounding decides
  double distance = 0;  ///< cut to ± truncation
};

Sample sample(const DepthFrame& frame, const VolumeConfig& config, Vec3i voxel) {
  const Camera& c = frame.camera;
  const Vec3d p = frame.T_world_camera.inverse() * (vec_cast<double>(voxel) * config.voxel_m);
  if (p.z < 0.01) return {};
  const double u = c.fx * p.x / p.z + c.cx + 0.5, v = c.fy * p.y / p.z + c.cy + 0.5;
  const int x = static_cast<int>(std::floor(u)), y = static_cast<int>(std::floor(v));
  constexpr double kRounding_px = 1e-4;
  Sample s;
  s.unsure =
      std::abs(u - std::round(u)) < kRounding_px || std::abs(v - std::round(v)) < kRounding_px;
  if (!frame.depth.contains(x, y) || !(*frame.depth.at(x, y) > 0)) return s;
  const double in_front = *frame.depth.at(x, y) - p.z, band = config.truncation_m;
  s.seen = in_front >= -band;
  s.unsure |= std::abs(in_front + band) < 1e-5 || std::abs(in_front) < 1e-5;
  s.distance = std::clamp(in_front, -band, band) / config.voxel_m;
  return s;
}

/// A dense grid of samples.
struct Field {
  Vec3i low, size;
  std::vector<Sample> samples;

  const Sample& at(Vec3i v) const {
    const Vec3i i = v - low;
    return samples[(static_cast<std::size_t>(i.z) * size.y + i.y) * size.x + i.x];
  }
};

Field dense_field(const DepthFrame& frame, const VolumeConfig& config) {
  Box3d seen;
  for (int y = 0; y < frame.depth.height; ++y)
    for (int x = 0; x < frame.depth.width; ++x) {
      const double depth = *frame.depth.at(x, y);
      const Vec3d ray = unproject(frame.camera, {static_cast<double>(x), static_cast<double>(y)});
      if (depth > 0) seen.add(frame.T_world_camera * (ray * depth));
    }
  Field field;
  const double margin = config.truncation_m / config.voxel_m + 4;
  for (int axis = 0; axis < 3; ++axis) {
    field.low[axis] = static_cast<int>(std::floor(seen.low[axis] / config.voxel_m - margin));
    field.size[axis] =
        static_cast<int>(std::ceil(seen.high[axis] / config.voxel_m + margin)) - field.low[axis];
  }
  for (int z = 0; z < field.size.z; ++z)
    for (int y = 0; y < field.size.y; ++y)
      for (int x = 0; x < field.size.x; ++x)
        field.samples.push_back(sample(frame, config, field.low + Vec3i{x, y, z}));
  return field;
}

enum class Answer { no, yes, unsure };

/// Whether an edge of the grid holds a vertex: it crosses the surface, and one of the four cells
/// around it was seen as a whole.
Answer holds_vertex(const Field& field, Vec3i low, int axis) {
  const int side = axis == 0 ? 1 : 0, up = axis == 2 ? 1 : 2;
  const auto step = [](int along, int by) {
    Vec3i out;
    out[along] = by;
    return out;
  };
  bool unsure = false, any_cell = false;
  for (int cell = 0; cell < 4; ++cell) {
    bool whole = true;
    for (int corner = 0; corner < 8; ++corner) {
      const Sample& s =
          field.at(low + step(axis, corner & 1) + step(side, (corner >> 1 & 1) - (cell & 1)) +
                   step(up, (corner >> 2) - (cell >> 1)));
      whole &= s.seen, unsure |= s.unsure;
    }
    any_cell |= whole;
  }
  if (unsure) return Answer::unsure;
  const bool crosses = (field.at(low).distance < 0) != (field.at(low + step(axis, 1)).distance < 0);
  return crosses && any_cell ? Answer::yes : Answer::no;
}

struct Agreement {
  std::size_t same = 0, missing = 0, extra = 0, unsure = 0;
  double farthest = 0;  ///< between the two's places of a vertex, in voxels
};

/// Vertices by the edge of the grid that they lie on: (low, axis) → place along it.
std::map<std::pair<Vec3i, int>, double> vertices_by_edge(const Mesh& mesh, double voxel_m) {
  std::map<std::pair<Vec3i, int>, double> out;
  for (const Vec3f p : mesh.positions) {
    int along = 0;
    double farthest = -1;
    Vec3i low;
    for (int axis = 0; axis < 3; ++axis) {
      const double v = p[axis] / voxel_m, off = std::abs(v - std::round(v));
      if (off > farthest) farthest = off, along = axis;
      low[axis] = static_cast<int>(std::lround(v));
    }
    low[along] = static_cast<int>(std::floor(p[along] / voxel_m));
    out[{low, along}] = p[along] / voxel_m - low[along];
  }
  return out;
}

Agreement compare(const Field& field, const Mesh& mesh, double voxel_m) {
  constexpr double kLeast = 1.0 / 256;
  auto ours = vertices_by_edge(mesh, voxel_m);
  Agreement out;
  for (int z = 1; z + 2 < field.size.z; ++z)
    for (int y = 1; y + 2 < field.size.y; ++y)
      for (int x = 1; x + 2 < field.size.x; ++x)
        for (int axis = 0; axis < 3; ++axis) {
          const Vec3i low = field.low + Vec3i{x, y, z};
          Vec3i next = low;
          ++next[axis];
          const double a = field.at(low).distance, b = field.at(next).distance;
          const auto found = ours.find({low, axis});
          const bool is_ours = found != ours.end();
          if ((a < 0) == (b < 0) && !is_ours) continue;
          const Answer answer = holds_vertex(field, low, axis);
          out.unsure += answer == Answer::unsure;
          if (answer == Answer::unsure) continue;
          out.missing += answer == Answer::yes && !is_ours;
          out.extra += answer == Answer::no && is_ours;
          if (answer == Answer::no || !is_ours) continue;
          ++out.same;
          // Where the field is flat, the same rounding of distances moves a vertex farther.
          const double steep = std::min(std::abs(a - b), 1.0);
          const double at = std::clamp(a / (a - b), kLeast, 1 - kLeast);
          out.farthest = std::max(out.farthest, std::abs(at - found->second) * steep);
        }
  return out;
}

struct Scene {
  std::string name;
  ImageDepth depth;
  double voxel_m, truncation_m;
};

const Camera& camera() {
  static const Camera c = test::pinhole(64, 48, 60);
  return c;
}

ImageDepth room_depth() {
  return test::depth_picture(test::furnished_room(), camera(), test::tilted_pose());
}

std::vector<Scene> scenes() {
  const test::Solids ball{{}, {}, {{{0.2, -0.02, 0.42}, 0.13}}};
  const ImageDepth view = test::depth_picture(ball, camera(), test::tilted_pose());
  return {{"room, 6 cm", room_depth(), 0.06, 0.12},
          {"noisy room, 4 cm", test::with_noise(room_depth(), 0.01, 5), 0.04, 0.08},
          {"ball, 4 mm", view, 0.004, 0.016},
          {"ball, 2.5 mm", view, 0.0025, 0.01},  // pixels lie three voxels apart
          {"random depth, 2 cm", test::random_depth(64, 48, 0.3, 0.9, 6), 0.02, 0.06}};
}

TEST(Volume, IsWhatTheDefinitionSays) {
  const Pose pose = test::tilted_pose();
  for (const Scene& s : scenes()) {
    const DepthFrame frame{s.depth, camera(), pose, test::whole(s.depth), {}};
    const VolumeConfig config = voxels(s.voxel_m, s.truncation_m, History::none);
    const Field field = dense_field(frame, config);
    const Mesh mesh = surface_of(config, frame, DepthEdges::bridge);
    const Agreement found = compare(field, mesh, s.voxel_m);
    EXPECT_GT(found.same, 500u) << s.name;
    EXPECT_EQ(found.missing, 0u) << s.name;
    EXPECT_EQ(found.extra, 0u) << s.name;
    EXPECT_LT(found.unsure, found.same) << s.name;
    // A stored distance is off by a step, and floats by a millionth of what they measure.
    const double step = s.truncation_m / fusion::VoxelBlock::kTruncated;
    const double far_m = *std::max_element(s.depth.data.begin(), s.depth.data.end());
    EXPECT_LT(found.farthest, (step + 1e-6 * far_m) / s.voxel_m) << s.name;
  }
}

/// The corners of all triangles, sorted, to compare meshes with different vertex order.
std::vector<std::array<Vec3f, 3>> sorted_corners(const Mesh& mesh) {
  std::vector<std::array<Vec3f, 3>> out;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    std::array<Vec3f, 3> c{mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)};
    std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());
    out.push_back(c);
  }
  std::sort(out.begin(), out.end());
  return out;
}

TEST(Volume, RowsThatAreSkippedHoldNoSurface) {
  // History::average computes whole blocks, History::none only rows that surface may cross.
  const Pose pose = test::tilted_pose();
  std::vector<Scene> all = scenes();
  // Pixels lie up to four voxels apart.
  all.push_back({"room, 1 cm", room_depth(), 0.01, 0.04});
  for (const Scene& s : all)
    for (const DepthEdges edges : {DepthEdges::cut, DepthEdges::bridge}) {
      const DepthFrame frame{s.depth, camera(), pose, test::whole(s.depth), {}};
      const Mesh rows = surface_of(voxels(s.voxel_m, s.truncation_m, History::none), frame, edges);
      const Mesh blocks =
          surface_of(voxels(s.voxel_m, s.truncation_m, History::average), frame, edges);
      EXPECT_EQ(rows.positions.size(), blocks.positions.size()) << s.name;
      EXPECT_EQ(rows.triangles.size(), blocks.triangles.size()) << s.name;
      EXPECT_TRUE(sorted_corners(rows) == sorted_corners(blocks)) << s.name;
    }
}

TEST(Volume, APatchOfThePictureIsAllThatCounts) {
  // The same as a picture in which the rest is invalid.
  const Pose pose = test::tilted_pose();
  const ImageDepth depth = test::depth_picture(test::furnished_room(), camera(), pose);
  const Rect region{7, 5, 31, 29};
  ImageDepth rest_gone(depth.width, depth.height);
  for (int y = region.y; y < region.y + region.height; ++y)
    std::copy_n(depth.at(region.x, y), region.width, rest_gone.at(region.x, y));
  for (const History history : {History::none, History::average}) {
    const VolumeConfig config = voxels(0.02, 0.08, history);
    const Mesh patch = surface_of(config, {depth, camera(), pose, region, {}}, DepthEdges::cut);
    const Mesh masked =
        surface_of(config, {rest_gone, camera(), pose, test::whole(depth), {}}, DepthEdges::cut);
    ASSERT_GT(patch.triangles.size(), 1000u);
    EXPECT_NEAR(
        static_cast<double>(patch.triangles.size()) / static_cast<double>(masked.triangles.size()),
        1, 2e-3);
    EXPECT_NEAR(surface_area_m2(patch) / surface_area_m2(masked), 1, 2e-3);
  }
}

// --- several frames and sensors

constexpr double kWall_m = 1.53;

ImageDepth flat(double depth_m) {
  return ImageDepth(camera().width, camera().height, static_cast<float>(depth_m));
}

double rms_from_wall_m(const Mesh& mesh) {
  double sum = 0;
  for (const Vec3f p : mesh.positions) sum += (p.z - kWall_m) * (p.z - kWall_m);
  return std::sqrt(sum / static_cast<double>(mesh.positions.size()));
}

TEST(Volume, NoiseOfManyFramesAveragesOut) {
  const Pose pose;
  const auto error_after_m = [&](int frames) {
    VoxelVolume volume(voxels(0.015, 0.06, History::average));
    for (int f = 0; f < frames; ++f) {
      const ImageDepth depth = test::with_noise(flat(kWall_m), 0.004, 10 + f);
      volume.integrate({depth, camera(), pose, test::whole(depth), Precision{0.002, 0}});
    }
    return rms_from_wall_m(fusion::extract_surface(volume));
  };
  const double one = error_after_m(1), two = error_after_m(2), sixteen = error_after_m(16);
  EXPECT_GT(one, 0.001);
  EXPECT_NEAR(two / one, std::sqrt(0.5), 0.08);
  EXPECT_NEAR(sixteen / one, 0.25, 0.06);
}

TEST(Volume, TheBetterSensorCountsMore) {
  // The far sensor is 0.5 m behind the near one; what they measure of the wall differs by 1 cm.
  constexpr double kNear_m = 1, kFar_m = 1.5, kApart_m = 0.01;
  const Precision precision{0.001, 0.002};
  const double ratio_near = precision.sigma_m(1) / precision.sigma_m(kNear_m),
               ratio_far = precision.sigma_m(1) / precision.sigma_m(kFar_m);
  const double near = std::round(16 * ratio_near * ratio_near),
               far = std::round(16 * ratio_far * ratio_far);
  for (const bool weighted : {true, false}) {
    VoxelVolume volume(voxels(0.01, 0.05, History::average));
    const std::optional<Precision> used = weighted ? std::optional(precision) : std::nullopt;
    const Pose near_pose{{}, {0, 0, kWall_m - kNear_m}}, far_pose{{}, {0, 0, kWall_m - kFar_m}};
    const ImageDepth near_depth = flat(kNear_m), far_depth = flat(kFar_m + kApart_m);
    volume.integrate({near_depth, camera(), near_pose, test::whole(near_depth), used});
    volume.integrate({far_depth, camera(), far_pose, test::whole(far_depth), used});
    const double share = weighted ? far / (near + far) : 0.5;
    const Mesh mesh = fusion::extract_surface(volume);
    // The weights change a little over the band; the surface lies where both are known.
    int checked = 0;
    for (const Vec3f p : mesh.positions) {
      if (std::abs(p.x) > 0.35 || std::abs(p.y) > 0.3) continue;  // seen by both
      EXPECT_NEAR(p.z, kWall_m + share * kApart_m, weighted ? 4e-4 : 1e-5);
      ++checked;
    }
    EXPECT_GT(checked, 1000);
  }
}

TEST(Volume, TheOrderOfSensorsHardlyMatters) {
  const std::vector<Vec3d> eyes{{0.13, -0.21, 0.07}, {-0.4, 0.1, 0.2}, {0.5, -0.3, -0.2}};
  std::vector<ImageDepth> depths;
  std::vector<Pose> poses;
  for (const Vec3d eye : eyes) {
    poses.push_back(look_at(eye, {0.1, 0.2, 1.6}, {0.1, -1, 0}));
    depths.push_back(test::depth_picture(test::furnished_room(), camera(), poses.back()));
  }
  std::vector<double> areas;
  for (const std::vector<int>& order : {std::vector{0, 1, 2}, std::vector{2, 0, 1}}) {
    VoxelVolume volume(voxels(0.03, 0.12, History::average));
    for (const int i : order)
      volume.integrate({depths[i], camera(), poses[i], test::whole(depths[i]), {}});
    areas.push_back(surface_area_m2(fusion::extract_surface(volume)));
  }
  EXPECT_NEAR(areas[1] / areas[0], 1, 0.02);
}

// --- memory

TEST(Volume, MemoryIsReportedAndBounded) {
  const Pose pose = test::tilted_pose();
  const ImageDepth depth = test::depth_picture(test::furnished_room(), camera(), pose);
  VolumeConfig config = voxels(0.01, 0.04, History::average);
  VoxelVolume all(config);
  ASSERT_EQ(all.integrate({depth, camera(), pose, test::whole(depth), {}}).left_out_blocks, 0u);
  const std::size_t blocks = all.order().size();
  EXPECT_GE(all.memory_bytes(), blocks * (sizeof(fusion::VoxelBlock) + 1024));
  config.most_blocks = blocks / 2;
  VoxelVolume half(config);
  const auto report = half.integrate({depth, camera(), pose, test::whole(depth), {}});
  EXPECT_LE(half.order().size(), blocks / 2);
  EXPECT_GT(half.order().size(), blocks / 4);
  EXPECT_GT(report.left_out_blocks, 0u);
  EXPECT_LT(half.memory_bytes(), all.memory_bytes());
  EXPECT_FALSE(fusion::extract_surface(half).empty());
}

TEST(Volume, ClearedIsAsNew) {
  const Pose pose = test::tilted_pose();
  const ImageDepth room = test::depth_picture(test::furnished_room(), camera(), pose);
  const ImageDepth wall = flat(1.2);
  for (const History history : {History::none, History::average}) {
    VoxelVolume used(voxels(0.02, 0.08, history)), fresh(voxels(0.02, 0.08, history));
    used.integrate({room, camera(), pose, test::whole(room), {}});
    used.clear();
    EXPECT_TRUE(fusion::extract_surface(used).empty());
    used.integrate({wall, camera(), pose, test::whole(wall), {}});
    fresh.integrate({wall, camera(), pose, test::whole(wall), {}});
    EXPECT_TRUE(fusion::extract_surface(used) == fusion::extract_surface(fresh));
  }
}

}  // namespace
}  // namespace mr
