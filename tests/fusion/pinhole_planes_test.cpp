// Where pixels of a pinhole lie far apart on one surface, it is whole; where two surfaces lie
// behind each other, nothing spans them.
#include <gtest/gtest.h>

#include <cmath>

#include "mr/fusion/frame_view.h"
#include "mr/fusion/fuse.h"
#include "mr/fusion/pinhole_planes.h"
#include "mr/kit/raycast.h"
#include "support/depth_pictures.h"

namespace mr {
namespace {

constexpr double kVoxel_m = 0.01;

Mesh fused(const ImageDepth& depth, const Camera& camera, bool slanted) {
  fusion::FrameFuser fuser({.voxel_m = kVoxel_m, .truncation_m = 0.04, .bounds = {}});
  return fuser
      .fuse({.depth = depth,
             .camera = camera,
             .T_world_camera = {},
             .region = {0, 0, depth.width, depth.height},
             .precision = Precision{},
             .slanted = slanted})
      .mesh;
}

/// Half of the pixels measure some place between their own and the next one along a column, as
/// pixels do that see both.
ImageDepth with_mixed_pixels(const ImageDepth& depth, std::uint64_t seed) {
  test::Random random(seed);
  ImageDepth out = depth;
  for (int y = 1; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      const bool mixed = random() % 2 == 0;
      const auto share = static_cast<float>(random.between(0.15, 0.85));
      const float here = *depth.at(x, y), there = *depth.at(x, y - 1);
      if (mixed && here > 0 && there > 0) *out.at(x, y) = here + share * (there - here);
    }
  return out;
}

/// A floor 0.7 m below the camera, seen from 6 to 10 degrees above it.
struct Floor {
  static constexpr double kHeight_m = 0.7, kNear_m = 4.2, kFar_m = 6;
  Camera camera = test::pinhole(120, 160, 252);
  ImageDepth depth;

  Floor() {
    depth = test::depth_picture(test::Solids{Box3d{{-10, -10, -10}, {10, kHeight_m, 10}}, {}, {}},
                                camera, {});
    for (float& d : depth.data)
      if (d < kNear_m || d > kFar_m) d = 0;
  }

  /// The share of the floor in view that has no surface within a voxel.
  double missing(const Mesh& mesh) const {
    const Mesh* meshes[] = {&mesh};
    const kit::RayScene rays(meshes);
    int missed = 0, all = 0;
    for (double z = kNear_m + 0.2; z < kFar_m - 0.2; z += 0.011)
      for (double x = -0.8; x < 0.8; x += 0.013, ++all)
        missed += !rays.nearest(vec_cast<float>(Vec3d{x, kHeight_m, z}), float(kVoxel_m));
    return static_cast<double>(missed) / all;
  }
};

TEST(PinholePlanes, AFloorSeenAtEightDegreesIsWhole) {
  const Floor floor;
  EXPECT_LT(floor.missing(fused(floor.depth, floor.camera, true)), 0.001);
  EXPECT_GT(floor.missing(fused(floor.depth, floor.camera, false)), 0.3);  // why there are planes
}

TEST(PinholePlanes, MixedPixelsDoNotTearIt) {
  const Floor floor;
  EXPECT_LT(floor.missing(fused(with_mixed_pixels(floor.depth, 1), floor.camera, true)), 0.1);
}

TEST(PinholePlanes, ALineNeverTakesAPixelBehindTheCamera) {
  // A line through six pixels, each step about the mean one, that passes the first behind infinity.
  constexpr float kSteps[] = {0, 0.11f, 0.22f, 1.22f, 3.1f, 4.98f};  // 0.1 to 1.9 of the mean
  fusion::FrameView view;
  view.width = 32, view.height = 8, view.stride = view.width + 2;
  view.depth.assign(static_cast<std::size_t>(view.height + 2) * view.stride + view.kPadding,
                    view.kNothing);
  view.s.resize(view.width + view.kPadding), view.t = view.s;
  view.per_pixel = {0.004f, 0.004f};
  for (int y = 0; y < view.height; ++y)
    for (int i = 0; i < 6; ++i) view.row(y)[10 + i] = 1 / (0.05f + 0.105f * kSteps[i]);
  fusion::fit_pinhole_planes(view);
  for (int y = 0; y < view.height; ++y)
    for (int i = 0; i < 6; ++i) EXPECT_GT(view.planes[view.place(10 + i, y)].inverse, 0.02f) << i;
}

TEST(PinholePlanes, NothingSpansADepthEdge) {
  // A board before a wall; one or two pixels around its edge measure something between.
  const Camera camera = test::pinhole(160, 120, 252);
  const ImageDepth exact = test::depth_picture(
      test::Solids{Box3d{{-5, -5, -5}, {5, 5, 3}}, {Box3d{{-0.3, -0.2, 2}, {0.3, 0.2, 2.01}}}, {}},
      camera, {});
  for (const int mixed : {0, 1, 2}) {
    ImageDepth depth = exact;
    for (int y = 0; y < depth.height; ++y)
      for (int x = 2; x + 2 < depth.width; ++x) {
        const float a = *exact.at(x - 1, y), b = *exact.at(x, y);
        if (std::abs(a - b) < 0.5f) continue;
        if (mixed > 0) *depth.at(x, y) = a + 0.45f * (b - a);
        if (mixed > 1) *depth.at(x - 1, y) = a + 0.2f * (b - a);
      }
    const Mesh mesh = fused(depth, camera, true);
    double between_m2 = 0;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const float z = mesh.centroid(t).z;
      if (z > 2.03f && z < 2.97f) between_m2 += 0.5 * length(mesh.area_normal(t));
    }
    // What mixed pixels measured is there, but no curtain between it and the surfaces: the edges
    // are 0.8 m long and the surfaces a metre apart.
    EXPECT_LT(between_m2, 0.02 * mixed + 1e-9) << mixed << " mixed pixels";
  }
}

}  // namespace
}  // namespace mr
