#include "mr/baseline/waechter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>

#include "atlas/walls.h"
#include "mr/baseline/single_views.h"
#include "mr/kit/topology.h"
#include "support/sensor_rig.h"

namespace mr {
namespace {

/// A wall, its left half textured by view 0, its right half by view 1.
struct TwoHalves {
  Mesh wall = test::wall(0.5f, 20);
  std::vector<int> label;

  TwoHalves() {
    for (std::size_t t = 0; t < wall.triangles.size(); ++t) label.push_back(wall.centroid(t).x > 0);
  }
  /// The sum that level_seams() makes least, with its colours at vertices in place of along edges:
  /// the same where colours are linear.
  double energy(const std::vector<Vec3d>& add, const baseline::ColorOfView& color) const {
    double sum = 0;
    const auto twin = kit::edge_table(wall).twin;
    const auto next = [](std::uint32_t h) { return h / 3 * 3 + (h + 1) % 3; };
    for (std::uint32_t h = 0; h < twin.size(); ++h) {
      const bool is_seam = twin[h] != kit::kNoTwin && label[h / 3] != label[twin[h] / 3];
      if (is_seam || twin[h] == kit::kNoTwin || h < twin[h]) {
        const Vec3d change = add[h] - add[next(h)];
        sum += 10 * dot(change, change);
      }
      if (!is_seam || twin[h] < h) continue;
      const auto from = vec_cast<double>(wall.positions[kit::edge_from(wall, h)]),
                 to = vec_cast<double>(wall.positions[kit::edge_to(wall, h)]);
      // The samples' middle, weighted by nearness, lies a quarter of the edge from its vertex.
      for (const auto& [here, there, share] :
           {std::tuple{h, next(twin[h]), 0.25}, std::tuple{next(h), twin[h], 0.75}}) {
        const Vec3d p = from + (to - from) * share;
        const Vec3d left =
            color(label[h / 3], p) + add[here] - color(label[twin[h] / 3], p) - add[there];
        sum += 0.5 * dot(left, left);  // two edges of a seam meet at a vertex
      }
    }
    return sum;
  }
};

double largest(const std::vector<Vec3d>& of) {
  double out = 0;
  for (const Vec3d& v : of) out = std::max({out, std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  return out;
}

TEST(Waechter, AConstantDifferenceIsSharedAndLeavesNoStep) {
  const TwoHalves halves;
  const auto add = baseline::level_seams(halves.wall, halves.label, [](int view, Vec3d) {
    return view == 0 ? Vec3d{100, 50, 20} : Vec3d{140, 50, 0};
  });
  for (std::size_t c = 0; c < add.size(); ++c) {
    const double side = halves.label[c / 3] == 0 ? 1 : -1;
    EXPECT_NEAR(add[c].x, side * 20, 0.1);
    EXPECT_NEAR(add[c].y, 0, 0.1);
    EXPECT_NEAR(add[c].z, side * -10, 0.1);
  }
}

TEST(Waechter, NothingNearTheLevellingCostsLess) {
  const TwoHalves halves;
  const baseline::ColorOfView color = [](int view, Vec3d p) {
    return view == 0 ? Vec3d{100 + 60 * p.y, 100, 100} : Vec3d{100, 90 - 20 * p.y, 100};
  };
  const auto add = baseline::level_seams(halves.wall, halves.label, color);
  const double least = halves.energy(add, color);
  EXPECT_LT(least, 0.9 * halves.energy(std::vector<Vec3d>(add.size()), color));
  // Another value for all corners of one vertex and one view.
  std::mt19937 random(3);
  for (int trial = 0; trial < 100; ++trial) {
    auto other = add;
    const std::uint32_t c = static_cast<std::uint32_t>(random() % add.size());
    const double by = trial % 2 ? 0.5 : -0.5;
    for (std::uint32_t d = 0; d < add.size(); ++d)
      if (halves.wall.triangles[d / 3][d % 3] == halves.wall.triangles[c / 3][c % 3] &&
          halves.label[d / 3] == halves.label[c / 3])
        other[d].x += by;
    EXPECT_GE(halves.energy(other, color), least - 1e-4);
  }
}

TEST(Waechter, WhatHasNoSeamOrNoViewIsLeftAlone) {
  TwoHalves halves;
  std::ranges::fill(halves.label, 0);
  const auto differing = [](int view, Vec3d) { return Vec3d{view * 50.0, 0, 0}; };
  EXPECT_EQ(largest(baseline::level_seams(halves.wall, halves.label, differing)), 0);
  for (std::size_t t = 0; t < halves.label.size(); t += 2) halves.label[t] = -1;
  EXPECT_EQ(largest(baseline::level_seams(halves.wall, halves.label, differing)), 0);
}

/// Two cameras before a wall, with their pictures.
struct TwoCameras : TwoHalves {
  std::vector<View> views{test::view(ViewId{0}, {-0.2, 0, 0}, {-0.2, 0, 2}),
                          test::view(ViewId{1}, {0.2, 0, 0}, {0.2, 0, 2})};
  std::vector<ImageRgb> pictures{ImageRgb(320, 240, 100), ImageRgb(320, 240, 140)};

  baseline::Photographed in(std::span<const kit::RayScene* const> hiding = {}) {
    pointers_ = {&pictures[0], &pictures[1]};
    return {&wall, views, pointers_, hiding};
  }
  /// A picture's value where a point of the wall lies.
  int shown(const std::vector<ImageRgb>& in, std::size_t view, Vec3d p) const {
    const auto pixel = project(views[view].camera(), views[view].T_world_camera.inverse() * p);
    return sample_bilinear(in[view], views[view].image_rect, pixel->x, pixel->y)[0];
  }

 private:
  std::vector<const ImageRgb*> pointers_;
};

TEST(Waechter, LevelledPicturesMeetAtTheSeamAndKeepTheirDetail) {
  TwoCameras two;
  // What global levelling cannot take away: a difference that alternates along the seam.
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x)
      for (int c = 0; c < 3; ++c) two.pictures[0].at(x, y)[c] = y / 12 % 2 ? 90 : 110;
  const auto levelled = baseline::levelled_pictures(two.in(), two.label);
  for (double y = -0.4; y < 0.4; y += 0.013) {
    EXPECT_NEAR(two.shown(levelled, 0, {0, y, 2}), two.shown(levelled, 1, {0, y, 2}), 8) << y;
    EXPECT_GT(
        std::abs(two.shown(two.pictures, 0, {0, y, 2}) - two.shown(two.pictures, 1, {0, y, 2})), 25)
        << y;
  }
  // Beyond the strip there is the picture and what was added to all of it.
  const auto at_left = [&](double y) { return Vec3d{-0.45, y, 2}; };
  for (double y = -0.4; y < 0.4; y += 0.013)
    EXPECT_NEAR(two.shown(levelled, 0, at_left(y)) - two.shown(two.pictures, 0, at_left(y)), 20, 3);
}

TEST(Waechter, ViewsWithMoreGradientAreBetterAndHiddenOnesAreNone) {
  TwoCameras two;
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x) two.pictures[1].at(x, y)[0] = x % 8 < 4 ? 90 : 190;
  const Mesh screen = test::grid({-0.6f, 0.6f, 1}, {0.4f, 0, 0}, {0, -1.2f, 0}, 1, 1);
  const Mesh* const meshes[] = {&screen};
  const kit::RayScene hiding(meshes);
  const kit::RayScene* const all[] = {&hiding};
  const auto open = baseline::gradient_sums(two.in());
  const auto hidden = baseline::gradient_sums(two.in(all));
  const std::size_t count = two.wall.triangles.size();
  std::size_t gone = 0;
  for (std::size_t t = 0; t < count; ++t) {
    EXPECT_GT(open[2 * t + 1], 10 * open[2 * t]);
    EXPECT_GT(open[2 * t], 0);
    // The screen reaches to x = -0.2 at half the way.
    const float edge = two.wall.centroid(t).x + 0.2f;
    if (std::abs(edge) > 0.06f) {
      EXPECT_EQ(hidden[2 * t] == 0, edge < 0) << edge;
    }
    gone += hidden[2 * t] == 0;
  }
  EXPECT_GT(gone, count / 5);
  for (auto& triangle : two.wall.triangles) std::swap(triangle[0], triangle[1]);
  for (const float sum : baseline::gradient_sums(two.in())) EXPECT_EQ(sum, 0) << "from behind";
}

TEST(Waechter, AViewThatIsALittleBetterInOnePlaceIsNotWorthItsSeam) {
  const Mesh wall = test::wall(0.5f, 10);
  std::vector<float> sums;
  for (std::size_t t = 0; t < wall.triangles.size(); ++t) sums.insert(sums.end(), {10, 1});
  sums[2 * 90] = 5, sums[2 * 90 + 1] = 6;  // amid view 0's
  sums[2 * 3] = 0, sums[2 * 3 + 1] = 1;    // seen by view 1 alone
  sums[2 * 7] = sums[2 * 7 + 1] = 0;       // by none
  const auto label = baseline::cut_views(wall, 2, sums);
  for (std::size_t t = 0; t < label.size(); ++t)
    EXPECT_EQ(label[t], t == 3 ? 1 : t == 7 ? -1 : 0) << t;
}

TEST(SingleViews, EachTriangleShowsOnePictureLevelledOrNot) {
  const Scene scene =
      test::scene_of_sensors({test::facing_the_wall(), test::facing_the_wall({0.8, 0, 0})});
  std::vector<Frame> capture;
  for (std::size_t s = 0; s < 2; ++s) {
    capture.push_back(test::frame_of(scene, sensor_at(s), 0, test::wall()));
    std::ranges::fill(capture[s].color.data, static_cast<std::uint8_t>(s == 0 ? 100 : 140));
  }
  const auto plain = baseline::single_view_scene(scene, capture, false);
  const auto levelled = baseline::single_view_scene(scene, capture, true);
  ASSERT_TRUE(plain && levelled);
  ASSERT_EQ(plain->chunks.size(), 1u);
  EXPECT_EQ(plain->chunks[0]->mesh, levelled->chunks[0]->mesh);
  for (const View& view : plain->views)
    EXPECT_EQ(*plain->textures.at(view.stream), capture[index_of(sensor_of(view.id))].color);
  const Mesh& wall = plain->chunks[0]->mesh;
  const auto labels = triangle_views(wall);
  double seen[2] = {}, unseen = 0;  // m²
  std::vector<int> shown;
  for (std::size_t t = 0; t < labels.size(); ++t) {
    const double area = 0.5 * length(wall.area_normal(t));
    const auto view = std::ranges::find(levelled->views, labels[t], &View::id);
    if (view == levelled->views.end()) {
      unseen += area;
      continue;
    }
    seen[view - levelled->views.begin()] += area;
    const auto pixel = project(view->camera(),
                               view->T_world_camera.inverse() * vec_cast<double>(wall.centroid(t)));
    shown.push_back(sample_bilinear(*levelled->textures.at(view->stream), view->image_rect,
                                    pixel->x, pixel->y)[0]);
  }
  // One colour between both.
  const auto [darkest, brightest] = std::ranges::minmax(shown);
  EXPECT_LE(brightest - darkest, 2);
  EXPECT_GT(darkest, 105);
  EXPECT_LT(brightest, 135);
  EXPECT_GT(seen[0], 0.2 * (seen[0] + seen[1]));
  EXPECT_GT(seen[1], 0.2 * (seen[0] + seen[1]));
  EXPECT_LT(unseen, 0.3 * (seen[0] + seen[1])) << "beside the colour pictures";
  Scene panorama = scene;
  panorama.sensors[0].color_camera->model = CameraModel::equirectangular;
  EXPECT_FALSE(baseline::single_view_scene(panorama, capture, true));
  std::ranges::fill(capture[0].depth.data, 0.0f), std::ranges::fill(capture[1].depth.data, 0.0f);
  EXPECT_FALSE(baseline::single_view_scene(scene, capture, true));
}

}  // namespace
}  // namespace mr
