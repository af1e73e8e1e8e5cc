#include "mr/atlas/labels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "atlas/walls.h"
#include "mr/atlas/label_history.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "support/meshes.h"

namespace mr {
namespace {

using test::labelled_area;
using test::view;
using test::wall;

/// No triangle of a view leaves its picture or its gutter.
void expect_inside(const Mesh& mesh, const View& v) {
  const auto views = triangle_views(mesh);
  for (std::size_t t = 0; t < views.size(); ++t) {
    if (views[t] != v.id) continue;
    for (int i = 0; i < 3; ++i) {
      const auto p =
          project(v.camera(), v.T_world_camera.inverse() * vec_cast<double>(mesh.corner(t, i)));
      ASSERT_TRUE(p);
      EXPECT_GE(p->x, v.gutter_px - 1e-6);
      EXPECT_LE(p->x, v.width - 1 - v.gutter_px + 1e-6);
      EXPECT_GE(p->y, v.gutter_px - 1e-6);
      EXPECT_LE(p->y, v.height - 1 - v.gutter_px + 1e-6);
    }
  }
}

TEST(Labels, WhatNoViewSeesHasNone) {
  const View v = view(ViewId{3}, {0, 0, 0}, {0, 0, 2});
  const Mesh mesh = atlas::label_triangles(wall(3, 60), {{v}}, {});
  expect_inside(mesh, v);
  // The view covers 320/260 · 2 by 240/260 · 2 metres of the wall, less the gutter.
  EXPECT_NEAR(labelled_area(mesh, ViewId{3}), 2.43 * 1.81, 0.15);
  EXPECT_GT(labelled_area(mesh, kNoView), 30);
}

TEST(Labels, FromBehindThereIsNothingToSee) {
  const Mesh mesh =
      atlas::label_triangles(wall(0.5f, 10), {{view(ViewId{0}, {0, 0, 4}, {0, 0, 2})}}, {});
  EXPECT_EQ(labelled_area(mesh, ViewId{0}), 0);
}

TEST(Labels, OccluderIsNotPaintedOntoTheWall) {
  Mesh scene = wall(0.8f, 2);  // large triangles: the occlusion edge has to be cut
  append(scene, test::grid({-0.2f, 0.2f, 1}, {0.4f, 0, 0}, {0, -0.4f, 0}, 8, 8));
  const View v = view(ViewId{0}, {0, 0, 0}, {0, 0, 2});
  const Mesh mesh =
      atlas::label_triangles(scene, {{v}}, {.geometry_error_m = 0.005, .min_edge_m = 0.02});
  EXPECT_NEAR(surface_area_m2(mesh), 1.6 * 1.6 + 0.16, 1e-3);
  // The occluder's shadow on the wall is 0.8 m wide. Nothing well inside it may be labelled; and
  // outside its margin everything is.
  const auto views = triangle_views(mesh);
  double outside = 0;
  for (std::size_t t = 0; t < views.size(); ++t) {
    const Vec3f c = mesh.centroid(t);
    if (c.z < 1.5f) continue;
    const float reach = std::max(std::abs(c.x), std::abs(c.y));
    if (reach < 0.36f) {
      EXPECT_EQ(views[t], kNoView) << c.x << " " << c.y;
    }
    if (reach > 0.5f && views[t] == kNoView) outside += 0.5 * length(mesh.area_normal(t));
  }
  EXPECT_LT(outside, 0.05);
}

TEST(Labels, WhatSplittingAddsLiesOnTheLattice) {
  const Lattice lattice{.origin = {}, .step_exp = -9};
  Mesh scene = wall(0.8f, 3);
  append(scene, test::grid({-0.2f, 0.2f, 1}, {0.4f, 0, 0}, {0, -0.4f, 0}, 8, 8));
  // Slivers of one step: the middles of two of their edges meet on the lattice.
  for (Vec3f& p : scene.positions) p = lattice.snap(p);
  const float step = static_cast<float>(lattice.step_m());
  append(scene, Mesh{{{-0.3f, 0.9f, 2}, {0.6f, 0.9f, 2}, {0.6f, 0.9f + step, 2}}, {{0, 1, 2}}});
  const std::size_t last = scene.positions.size() - 3;
  for (std::size_t v = last; v < scene.positions.size(); ++v)
    scene.positions[v] = lattice.snap(scene.positions[v]);
  const View v = view(ViewId{0}, {0, 0, 0}, {0, 0, 2});
  const Mesh mesh = atlas::label_triangles(
      scene, {{v}}, {.geometry_error_m = 0.005, .min_edge_m = 0.02, .lattice = lattice});
  EXPECT_GT(mesh.triangles.size(), scene.triangles.size() + 10) << "it was split";
  for (const Vec3f p : mesh.positions) EXPECT_EQ(p, lattice.snap(p));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) EXPECT_NE(mesh.corner(t, i), mesh.corner(t, (i + 1) % 3));
  EXPECT_NEAR(surface_area_m2(mesh), surface_area_m2(scene), 1e-3);
}

TEST(Labels, BestAngleTakesTheMostDirectView) {
  const std::vector<View> views = {view(ViewId{0}, {-1.5, 0, 0.5}, {0, 0, 2}),
                                   view(ViewId{1}, {0, 0, 0}, {0, 0, 2})};
  const Mesh mesh = atlas::label_triangles(wall(0.4f, 10), views,
                                           {.views = atlas::AtlasConfig::Views::best_angle});
  EXPECT_NEAR(labelled_area(mesh, ViewId{1}), 0.64, 1e-3);
}

/// The alpha plane of a view's picture; 0 in columns [first, last) of the camera.
AlphaByStream cut_columns(const View& v, int first, int last) {
  auto alpha =
      std::make_shared<Alpha>(Alpha{2, ImageMask((v.width + 1) / 2, (v.height + 1) / 2, 1)});
  for (int y = 0; y < alpha->plane.height; ++y)
    for (int x = first / 2; x < last / 2; ++x) *alpha->plane.at(x, y) = 0;
  return {{v.stream, alpha}};
}

/// Two views of a wall; the first one sees it better.
std::vector<View> better_and_worse() {
  std::vector<View> views = {view(ViewId{0}, {0, 0, 0}, {0, 0, 2}),
                             view(ViewId{1}, {0, 0, -1}, {0, 0, 2})};
  views[1].stream = StreamId{1};
  for (View& v : views) v.atlas_rect = v.image_rect;
  return views;
}

TEST(Labels, AViewThatShowsSomethingElseTexturesNothingThere) {
  const std::vector<View> views = better_and_worse();
  const Mesh mesh = wall(0.6f, 24);
  EXPECT_NEAR(labelled_area(atlas::label_triangles(mesh, views, {}), ViewId{0}), 1.44, 1e-3);
  const Mesh labelled =
      atlas::label_triangles(mesh, views, {.alpha = cut_columns(views[0], 0, views[0].width / 2)});
  EXPECT_NEAR(labelled_area(labelled, ViewId{1}), 0.72, 0.08);
  EXPECT_NEAR(labelled_area(labelled, ViewId{0}), 0.72, 0.08);
}

TEST(Labels, WhatNoOtherViewSeesIsLeftToAlpha) {
  const std::vector<View> views = {better_and_worse()[0]};
  const Mesh labelled = atlas::label_triangles(
      wall(0.6f, 24), views, {.alpha = cut_columns(views[0], 0, views[0].width / 2)});
  EXPECT_NEAR(labelled_area(labelled, ViewId{0}), 1.44, 1e-3);
}

/// Blocks of 16 pixels of a view; `is_valid`: of a column and row.
template <typename IsValid>
TileMask blocks(const View& v, const IsValid& is_valid) {
  TileMask out{16, (v.width + 15) / 16, (v.height + 15) / 16, {}};
  for (int row = 0; row < out.rows; ++row)
    for (int column = 0; column < out.columns; ++column) out.tiles.push_back(is_valid(column, row));
  return out;
}

/// No point of a view's triangles lies in a block that is not valid.
void expect_valid(const Mesh& mesh, const View& v, const TileMask& valid) {
  const auto views = triangle_views(mesh);
  for (std::size_t t = 0; t < views.size(); ++t) {
    if (views[t] != v.id) continue;
    for (int i = 0; i <= 20; ++i)
      for (int j = 0; i + j <= 20; ++j) {
        const Vec3f p = mesh.corner(t, 0) + (mesh.corner(t, 1) - mesh.corner(t, 0)) * (0.05f * i) +
                        (mesh.corner(t, 2) - mesh.corner(t, 0)) * (0.05f * j);
        const auto pixel = project(v.camera(), v.T_world_camera.inverse() * vec_cast<double>(p));
        ASSERT_TRUE(pixel);
        // Within a pixel of the border between two blocks it may be either.
        const auto block = [](double at) { return static_cast<int>(std::lround(at)) / 16; };
        bool any = false;
        for (const double d : {-1.0, 1.0})
          for (const double e : {-1.0, 1.0})
            any |= valid.at(std::clamp(block(pixel->x + d), 0, valid.columns - 1),
                            std::clamp(block(pixel->y + e), 0, valid.rows - 1));
        EXPECT_TRUE(any) << pixel->x << " " << pixel->y;
      }
  }
}

TEST(Labels, OnlyWhereAViewIsValid) {
  const View v = view(ViewId{3}, {0, 0, 0}, {0, 0, 2});
  const TileMask valid = blocks(v, [](int column, int) { return column < 10; });  // the left half
  const Mesh mesh = atlas::label_triangles(wall(0.6f, 2), {{v}}, {.valid = {{ViewId{3}, valid}}});
  expect_valid(mesh, v, valid);
  EXPECT_NEAR(labelled_area(mesh, ViewId{3}), 0.5 * 1.2 * 1.2, 0.06);  // cut along the border
  EXPECT_EQ(atlas::label_triangles(wall(0.6f, 2), {{v}}, {.valid = {{ViewId{4}, valid}}}),
            atlas::label_triangles(wall(0.6f, 2), {{v}}, {}));
}

TEST(Labels, WhereAViewIsNotValidAnotherIsTaken) {
  const std::vector<View> views = {view(ViewId{0}, {0, 0, 0}, {0, 0, 2}),
                                   view(ViewId{1}, {-1, 0, 0}, {0, 0, 2})};
  const auto odd = [](int column, int row) { return (column / 4 + row / 4) % 2 == 1; };
  const std::map<ViewId, TileMask> valid = {{ViewId{0}, blocks(views[0], odd)}};
  const Mesh mesh = atlas::label_triangles(wall(0.5f, 40), views, {.valid = valid});
  expect_valid(mesh, views[0], valid.at(ViewId{0}));
  EXPECT_GT(labelled_area(mesh, ViewId{0}), 0.3);
  EXPECT_NEAR(labelled_area(mesh, kNoView), 0, 1e-3);
}

TEST(Labels, ViewsThatAreNowhereValidCutNothing) {
  const View v = view(ViewId{0}, {0, 0, 0}, {0, 0, 2});
  const TileMask none = blocks(v, [](int, int) { return false; });
  const Mesh mesh = atlas::label_triangles(wall(0.6f, 2), {{v}}, {.valid = {{ViewId{0}, none}}});
  EXPECT_EQ(mesh.views, (std::vector<ViewRun>{{0, 8, kNoView}}));
}

TEST(Labels, CoherentLabelsHaveShorterBorders) {
  const std::vector<View> views = {view(ViewId{0}, {-0.4, 0, 0}, {-0.1, 0, 2}),
                                   view(ViewId{1}, {0.4, 0, 0}, {0.1, 0, 2})};
  // A bumpy wall: the angle test alone flickers between two views of about the same angle.
  const Mesh bumpy = test::grid({-0.6f, 0.6f, 2}, {1.2f, 0, 0}, {0, -1.2f, 0}, 30, 30, 0.01f, 5);
  const auto border = [&](atlas::AtlasConfig::Views mode) {
    const Mesh mesh =
        atlas::label_triangles(bumpy, views, {.views = mode, .geometry_error_m = 0.02});
    const auto label = triangle_views(mesh);
    const kit::EdgeTable edges = kit::edge_table(mesh);
    int count = 0;
    for (std::size_t h = 0; h < edges.twin.size(); ++h)
      count += edges.twin[h] != kit::kNoTwin && label[h / 3] != label[edges.twin[h] / 3];
    return count;
  };
  EXPECT_LT(border(atlas::AtlasConfig::Views::coherent),
            border(atlas::AtlasConfig::Views::best_angle));
}

/// Connected triangles of one view, their areas in m².
std::vector<double> region_areas_m2(const Mesh& mesh) {
  const auto label = triangle_views(mesh);
  const auto twin = kit::edge_table(mesh).twin;
  std::vector<double> out;
  std::vector<std::uint8_t> is_done(label.size());
  for (std::uint32_t seed = 0; seed < label.size(); ++seed) {
    if (is_done[seed] || label[seed] == kNoView) continue;
    std::vector<std::uint32_t> queue{seed};
    is_done[seed] = 1;
    double area = 0;
    for (std::size_t i = 0; i < queue.size(); ++i) {
      area += 0.5 * length(mesh.area_normal(queue[i]));
      for (std::uint32_t h = 3 * queue[i]; h < 3 * queue[i] + 3; ++h)
        if (twin[h] != kit::kNoTwin && label[twin[h] / 3] == label[seed] && !is_done[twin[h] / 3])
          is_done[twin[h] / 3] = 1, queue.push_back(twin[h] / 3);
    }
    out.push_back(area);
  }
  return out;
}

const std::vector<View> kSideBySide = {view(ViewId{0}, {-0.4, 0, 0}, {-0.1, 0, 2}),
                                       view(ViewId{1}, {0.4, 0, 0}, {0.1, 0, 2})};

/// A wall that is as rough as a moving surface, anew with each seed.
Mesh rough_wall(unsigned seed) {
  return test::grid({-0.6f, 0.6f, 2}, {1.2f, 0, 0}, {0, -1.2f, 0}, 40, 40, 0.01f, seed);
}

TEST(Labels, NoRegionIsUnder50SquareCentimetres) {
  const Mesh mesh = atlas::label_triangles(rough_wall(5), kSideBySide, {.geometry_error_m = 0.02});
  for (const double area : region_areas_m2(mesh)) EXPECT_GE(area, 0.005);
  const Mesh frontal = atlas::label_triangles(
      rough_wall(5), kSideBySide,
      {.views = atlas::AtlasConfig::Views::best_angle, .geometry_error_m = 0.02});
  EXPECT_GT(std::ranges::count_if(region_areas_m2(frontal), [](double a) { return a < 0.005; }), 0);
}

TEST(Labels, AMovingSurfaceKeepsItsViews) {
  // The share of the wall that has another view than a capture before, on average.
  const auto change = [&](bool keep) {
    atlas::LabelHistory history;
    double changed = 0;
    constexpr int kCaptures = 8;
    for (unsigned capture = 1; capture <= kCaptures; ++capture) {
      atlas::LabelConfig config{.geometry_error_m = 0.02};
      config.history = keep && capture > 1 ? &history : nullptr;
      // Between the two cameras the better view depends on noise alone.
      const Mesh mesh = atlas::label_triangles(rough_wall(capture), kSideBySide, config);
      const auto label = triangle_views(mesh);
      double off = 0;
      for (std::size_t t = 0; t < label.size() && capture > 1; ++t)
        if (history.at(mesh.centroid(t)) != label[t]) off += 0.5 * length(mesh.area_normal(t));
      changed += off / surface_area_m2(mesh) / (kCaptures - 1);
      history = atlas::LabelHistory(mesh);
    }
    return changed;
  };
  const double kept = change(true), anew = change(false);
  EXPECT_LT(kept, 0.015);
  EXPECT_LT(kept, 0.5 * anew);
}

TEST(Labels, SameOnAnyNumberOfThreads) {
  const std::vector<View> views = {view(ViewId{0}, {-0.4, 0, 0}, {0, 0, 2}),
                                   view(ViewId{1}, {0.4, 0, 0}, {0, 0, 2})};
  std::vector<Mesh> results;
  for (const int threads : {1, 2, 8}) {
    Arena arena(threads);
    arena.run([&] { results.push_back(atlas::label_triangles(wall(1, 20), views, {})); });
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
}

TEST(Labels, NoViewsNoLabels) {
  const Mesh mesh = atlas::label_triangles(wall(1, 2), {}, {});
  EXPECT_EQ(mesh.views, (std::vector<ViewRun>{{0, 8, kNoView}}));
}

/// All around the origin; looks along z.
View panorama(ViewId id, Vec3d eye = {}) {
  View v;
  v.id = id, v.kind = View::Kind::equirectangular, v.width = 512, v.height = 256;
  v.T_world_camera.translation = eye;
  v.image_rect = v.atlas_rect = {0, 0, 512, 256};
  return v;
}

/// A box of 4 x 2 x 4 m around the origin, seen from inside, of `cells`² · 2 triangles a side.
Mesh room(int cells) {
  Mesh mesh;
  const auto side = [&](Vec3f origin, Vec3f u, Vec3f v) {
    append(mesh, test::grid(origin, u, v, cells, cells));
  };
  side({-2, 1, 2}, {4, 0, 0}, {0, -2, 0}), side({2, 1, -2}, {-4, 0, 0}, {0, -2, 0});
  side({2, 1, 2}, {0, 0, -4}, {0, -2, 0}), side({-2, 1, -2}, {0, 0, 4}, {0, -2, 0});
  side({-2, 1, -2}, {4, 0, 0}, {0, 0, 4}), side({-2, -1, 2}, {4, 0, 0}, {0, 0, -4});
  return mesh;
}

TEST(Labels, PanoramaTexturesTheWholeRoomAcrossItsSeamAndPoles) {
  const Mesh input = room(8);
  const double area = surface_area_m2(input);
  EXPECT_NEAR(area, 64, 1e-3);
  const View v = panorama(ViewId{7});
  const Mesh mesh = atlas::label_triangles(input, {{v}}, {.min_edge_m = 0.05});
  EXPECT_NEAR(surface_area_m2(mesh), area, 1e-3);
  EXPECT_GT(labelled_area(mesh, ViewId{7}), 0.995 * area);
  // What lies across the seam, behind at x = 0, or over a pole is small.
  double across = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    double left = 1e9, right = -1e9;
    for (int i = 0; i < 3; ++i) {
      const auto p = project(v.camera(), vec_cast<double>(mesh.corner(t, i)));
      ASSERT_TRUE(p);
      left = std::min(left, p->x), right = std::max(right, p->x);
    }
    if (right - left > 256) across += 0.5 * length(mesh.area_normal(t));
  }
  EXPECT_LT(across, 0.02 * area);
}

TEST(Labels, OnlyWhereAPanoramaIsValid) {
  const View v = panorama(ViewId{7});
  // Around the seam and one of the poles, and not in between.
  const TileMask valid =
      blocks(v, [](int column, int row) { return column < 8 || column >= 24 || row < 4; });
  const Mesh mesh =
      atlas::label_triangles(room(8), {{v}}, {.min_edge_m = 0.05, .valid = {{ViewId{7}, valid}}});
  expect_valid(mesh, v, valid);
  const double whole =
      labelled_area(atlas::label_triangles(room(8), {{v}}, {.min_edge_m = 0.05}), ViewId{7});
  EXPECT_GT(labelled_area(mesh, ViewId{7}), 0.5 * whole);
  EXPECT_LT(labelled_area(mesh, ViewId{7}), 0.75 * whole);
}

TEST(Labels, PanoramaPaintsNoOccluderOntoTheWall) {
  // A board beside the camera, at its right, where no pinhole that looks along z would see it.
  Mesh scene = room(8);
  append(scene, test::grid({1, 0.2f, 0.2f}, {0, 0, -0.4f}, {0, -0.4f, 0}, 8, 8));
  const Mesh mesh = atlas::label_triangles(scene, {{panorama(ViewId{0})}},
                                           {.geometry_error_m = 0.005, .min_edge_m = 0.02});
  const auto views = triangle_views(mesh);
  double hidden = 0, beside = 0, board = 0;
  for (std::size_t t = 0; t < views.size(); ++t) {
    const Vec3f c = mesh.centroid(t);
    const double area = 0.5 * length(mesh.area_normal(t));
    const bool on_board = std::abs(c.x - 1) < 0.01f && std::abs(c.z) < 0.3f && std::abs(c.y) < 0.3f;
    if (on_board && views[t] == ViewId{0}) board += area;
    if (c.x < 1.99f) continue;  // the wall behind it: its shadow reaches 0.4 m to each side
    const float reach = std::max(std::abs(c.y), std::abs(c.z));
    if (reach < 0.34f && views[t] == ViewId{0}) hidden += area;
    if (reach > 0.52f && views[t] != ViewId{0}) beside += area;
  }
  EXPECT_EQ(hidden, 0);
  EXPECT_LT(beside, 0.05);
  EXPECT_NEAR(board, 0.16, 0.01);
}

TEST(Labels, PinholeAndPanoramaShareTheRoom) {
  // The pinhole is close to one wall; the panorama is to the side.
  View near = view(ViewId{1}, {0, 0, 0.8}, {0, 0, 2});
  const View around = panorama(ViewId{0}, {-1.2, 0, 0.3});
  const Mesh mesh =
      atlas::label_triangles(room(20), {{around, near}},
                             {.views = atlas::AtlasConfig::Views::best_angle, .min_edge_m = 0.05});
  EXPECT_GT(labelled_area(mesh, ViewId{1}), 0.8);
  EXPECT_GT(labelled_area(mesh, ViewId{0}), 60);
  expect_inside(mesh, near);
}

TEST(Labels, OfPanoramasAreTheSameOnAnyNumberOfThreads) {
  const std::vector<View> views = {panorama(ViewId{0}, {-1, 0, 0}), panorama(ViewId{1}, {1, 0, 0})};
  std::vector<Mesh> results;
  for (const int threads : {1, 8}) {
    Arena arena(threads);
    arena.run([&] { results.push_back(atlas::label_triangles(room(10), views, {})); });
  }
  EXPECT_EQ(results[0], results[1]);
}

}  // namespace
}  // namespace mr
