#include "mr/atlas/lasting_labels.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <span>
#include <vector>

#include "atlas/walls.h"
#include "mr/atlas/label_history.h"
#include "mr/atlas/occluders.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "support/meshes.h"

namespace mr {
namespace {

using atlas::LabelConfig;
using atlas::LastingLabels;
using Extent = LastingLabels::Extent;
using test::labelled_area;

const std::vector<View> kViews = {test::view(ViewId{0}, {-0.5, 0, 0}, {0, 0, 2}),
                                  test::view(ViewId{1}, {0.5, 0, 0}, {0, 0, 2})};
const LabelConfig kConfig{.geometry_error_m = 0.005, .min_edge_m = 0.02};

const Mesh kWall = test::wall(0.8f, 6);

/// The wall, and something before it.
Mesh wall_and_box() {
  Mesh out = kWall;
  append(out, test::grid({-0.2f, 0.2f, 1.2f}, {0.4f, 0, 0}, {0, -0.4f, 0}, 8, 8));
  return out;
}

/// The length of all edges that only one triangle has: longer where a cut leaves a crack.
double border_m(const Mesh& mesh) {
  double sum = 0;
  const auto twin = kit::edge_table(mesh).twin;
  for (std::uint32_t h = 0; h < twin.size(); ++h)
    if (twin[h] == kit::kNoTwin)
      sum +=
          length(mesh.positions[kit::edge_to(mesh, h)] - mesh.positions[kit::edge_from(mesh, h)]);
  return sum;
}

/// [corners] of the triangles, in order.
std::vector<std::array<Vec3f, 3>> soup(const Mesh& mesh, const std::function<bool(Vec3f)>& where) {
  std::vector<std::array<Vec3f, 3>> out;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (where(mesh.centroid(t)))
      out.push_back({mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)});
  return out;
}

TEST(LastingLabels, AtFirstTheyAreThoseOfTheWholeSurface) {
  LastingLabels labels;
  EXPECT_EQ(labels.update(wall_and_box(), kViews, kConfig, Extent::changes),
            atlas::label_triangles(wall_and_box(), kViews, kConfig));
}

TEST(LastingLabels, WithoutChangesNothingChanges) {
  LastingLabels labels;
  const Mesh before = labels.update(wall_and_box(), kViews, kConfig, Extent::everything);
  const Mesh after = labels.update(wall_and_box(), kViews, kConfig, Extent::changes);
  const auto everywhere = [](Vec3f) { return true; };
  EXPECT_EQ(soup(after, everywhere), soup(before, everywhere));
  EXPECT_EQ(after.views, before.views);
  EXPECT_EQ(labels.update(wall_and_box(), kViews, kConfig, Extent::everything), before);
}

TEST(LastingLabels, WhatComesBeforeAWallIsNotPaintedOntoIt) {
  LastingLabels labels;
  labels.update(kWall, kViews, kConfig, Extent::everything);
  const Mesh mesh = labels.update(wall_and_box(), kViews, kConfig, Extent::changes);
  const Mesh anew = atlas::label_triangles(wall_and_box(), kViews, kConfig);
  for (const ViewId id : {ViewId{0}, ViewId{1}, kNoView})
    EXPECT_NEAR(labelled_area(mesh, id), labelled_area(anew, id), 0.05) << number_of(id);
  EXPECT_NEAR(border_m(mesh), 4 * 1.6 + 4 * 0.4, 1e-4);
}

TEST(LastingLabels, WhatIsUncoveredGetsAView) {
  LastingLabels labels;
  labels.update(wall_and_box(), kViews, kConfig, Extent::everything);
  const Mesh mesh = labels.update(kWall, kViews, kConfig, Extent::changes);
  EXPECT_NEAR(labelled_area(mesh, kNoView), 0, 1e-4);
  EXPECT_NEAR(border_m(mesh), 4 * 1.6, 1e-4);
}

TEST(LastingLabels, InAHurryWhatGoesGoesAndWhatItHidWaits) {
  LastingLabels labels;
  const std::span one(kViews.data(), 1);  // the other one sees what is behind the box
  const Mesh before = labels.update(wall_and_box(), one, kConfig, Extent::everything);
  const Mesh hurried = labels.update(kWall, one, kConfig, Extent::new_surface);
  const auto of_wall = [](Vec3f p) { return p.z > 1.5f; };
  EXPECT_EQ(soup(hurried, of_wall), soup(before, of_wall));
  EXPECT_EQ(soup(hurried, of_wall).size(), hurried.triangles.size());
  EXPECT_GT(labelled_area(hurried, kNoView), 0.01);
  // What was old is seen however often there was a hurry since, and though nothing else changes.
  labels.update(kWall, one, kConfig, Extent::new_surface);
  const Mesh seen = labels.update(kWall, one, kConfig, Extent::changes);
  EXPECT_NEAR(labelled_area(seen, kNoView), 0, 1e-4);
}

TEST(LastingLabels, WhereTheSurfaceStaysItsTrianglesStay) {
  LastingLabels labels;
  const Mesh before = labels.update(kWall, kViews, kConfig, Extent::everything);
  // A corner of the wall comes forward a little: other triangles there, none elsewhere.
  Mesh bulged = kWall;
  for (Vec3f& p : bulged.positions)
    if (p.x > 0.4f && p.y > 0.4f) p.z -= 0.02f;
  const Mesh after = labels.update(bulged, kViews, kConfig, Extent::changes);
  const auto far_away = [](Vec3f p) { return p.x < 0.2f || p.y < 0.2f; };
  EXPECT_EQ(soup(after, far_away), soup(before, far_away));
  EXPECT_NEAR(border_m(after), border_m(bulged), 1e-4);
}

TEST(LastingLabels, CutsMeetThoseOfNewTriangles) {
  LastingLabels labels;
  labels.update(wall_and_box(), kViews, kConfig,
                Extent::everything);  // the wall is cut around the shadows
  Mesh other = wall_and_box();
  for (Vec3f& p : other.positions)
    if (p.z > 1.9f && p.x > 0.1f) p.z += 0.01f;
  const Mesh mesh = labels.update(other, kViews, kConfig, Extent::changes);
  EXPECT_NEAR(border_m(mesh), border_m(other), 1e-4);
  EXPECT_NEAR(surface_area_m2(mesh), surface_area_m2(other), 1e-4);
}

TEST(LastingLabels, BlocksThatBecomeValidAreUsedAndSuchAsAreNotAreLeft) {
  const auto blocks = [](int columns) {
    TileMask out{16, 20, 15, {}};
    for (int i = 0; i < 20 * 15; ++i) out.tiles.push_back(i % 20 < columns);
    return out;
  };
  const std::vector<View> one = {kViews[0]};
  const auto config = [&](int columns) {
    LabelConfig out = kConfig;
    out.valid = {{ViewId{0}, blocks(columns)}};
    return out;
  };
  LastingLabels labels;
  double last = -1;
  for (const int columns : {0, 6, 12, 20}) {
    const double area =
        labelled_area(labels.update(kWall, one, config(columns), Extent::changes), ViewId{0});
    EXPECT_GT(area, last) << columns;
    last = area;
  }
  const Mesh fewer = labels.update(kWall, one, config(6), Extent::changes);
  EXPECT_NEAR(labelled_area(fewer, ViewId{0}),
              labelled_area(atlas::label_triangles(kWall, one, config(6)), ViewId{0}), 0.03);
}

TEST(LastingLabels, SurfaceMadeAnewKeepsItsViews) {
  // A third of the wall is made anew with every capture, a little elsewhere, as where the still
  // picture is refined; labels are chosen anew everywhere now and then.
  const auto wall = [](unsigned capture) {
    Mesh out = test::wall(0.8f, 40);
    std::mt19937 random(capture);
    for (Vec3f& p : out.positions)
      if (p.y < -0.25f) p.z += 0.004f * (static_cast<float>(random() % 1001) / 500 - 1);
    return out;
  };
  LastingLabels labels;
  atlas::LabelHistory before(labels.update(wall(0), kViews, kConfig, Extent::everything));
  for (unsigned capture = 1; capture <= 6; ++capture) {
    const Mesh mesh = labels.update(wall(capture), kViews, kConfig,
                                    capture % 3 == 0 ? Extent::everything : Extent::changes);
    const auto label = triangle_views(mesh);
    double changed = 0;
    for (std::size_t t = 0; t < label.size(); ++t)
      if (before.at(mesh.centroid(t)) != label[t]) changed += 0.5 * length(mesh.area_normal(t));
    EXPECT_LT(changed, 0.001 * surface_area_m2(mesh)) << capture;
    before = atlas::LabelHistory(mesh);
  }
}

/// The area of the first view's triangles after a part of its disc of 130 cm², right of `from_x`,
/// is labelled again, amid a wall of the second view, which shows all of it better.
double left_of_disc_m2(float from_x, double least_region_m2) {
  const std::vector<View> views = {test::view(ViewId{0}, {-0.9, 0, 0}, {0, 0, 2}),
                                   test::view(ViewId{1}, {0, 0, 0}, {0, 0, 2})};
  auto surface = atlas::Labelling::of(test::wall(0.5f, 100));
  for (std::size_t t = 0; t < surface.label.size(); ++t) {
    const Vec3f p = surface.mesh.centroid(t);
    const bool in_disc = std::hypot(p.x, p.y) < 0.065f;
    surface.label[t] = in_disc ? 0 : 1, surface.is_due[t] = in_disc && p.x > from_x;
  }
  const atlas::Occluders occluders(surface.mesh, views);
  LabelConfig config = kConfig;
  config.occluders = &occluders, config.least_region_m2 = least_region_m2;
  atlas::label_due(surface, views, config);
  double out = 0;
  for (std::size_t t = 0; t < surface.label.size(); ++t)
    if (surface.label[t] == 0) out += 0.5 * length(surface.mesh.area_normal(t));
  return out;
}

TEST(LastingLabels, WhatIsLeftOfARegionGoesWithTheRestIfItIsTooSmall) {
  EXPECT_EQ(left_of_disc_m2(-0.02f, 0.005), 0);
  EXPECT_NEAR(left_of_disc_m2(-0.02f, 0.003), 0.004, 0.0007);
  EXPECT_NEAR(left_of_disc_m2(0.01f, 0.005), 0.008, 0.001);
}

TEST(LastingLabels, AnotherCameraIsAnotherMatter) {
  LastingLabels labels;
  labels.update(wall_and_box(), kViews, kConfig, Extent::everything);
  const std::vector<View> moved = {test::view(ViewId{0}, {-0.4, 0.1, 0}, {0, 0, 2}), kViews[1]};
  EXPECT_EQ(labels.update(wall_and_box(), moved, kConfig, Extent::changes),
            atlas::label_triangles(wall_and_box(), moved, kConfig));
  EXPECT_TRUE(labels.update({}, moved, kConfig, Extent::changes).empty());
}

TEST(LastingLabels, SameOnAnyNumberOfThreads) {
  std::vector<Mesh> results;
  for (const int threads : {1, 4}) {
    Arena arena(threads);
    arena.run([&] {
      LastingLabels labels;
      labels.update(kWall, kViews, kConfig, Extent::everything);
      results.push_back(labels.update(wall_and_box(), kViews, kConfig, Extent::changes));
    });
  }
  EXPECT_EQ(results[0], results[1]);
}

}  // namespace
}  // namespace mr
