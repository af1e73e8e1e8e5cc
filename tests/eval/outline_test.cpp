#include "mr/eval/outline.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <utility>

#include "eval/small_scene.h"
#include "mr/eval/geometry_error.h"
#include "mr/eval/sensor_coverage.h"
#include "mr/eval/viewpoints.h"
#include "mr/synth/truth.h"

namespace mr::eval {
namespace {

/// A rectangle of pixels.
ImageMask rectangle(int x, int y, int width, int height, int of_width = 200, int of_height = 150) {
  ImageMask out(of_width, of_height);
  for (int j = y; j < y + height; ++j)
    for (int i = x; i < x + width; ++i) *out.at(i, j) = 1;
  return out;
}

double mean(const OutlineDistance& d) { return d.sum_px / static_cast<double>(d.pixels); }

TEST(Outline, PeopleStandOutFromTheRoom) {
  ImageDepth room(5, 1, 3.0f), depth(5, 1, 3.0f);
  *depth.at(0, 0) = 2.94f, *depth.at(1, 0) = 2.96f, *depth.at(2, 0) = 0;
  *room.at(3, 0) = 0;  // something before nothing
  *depth.at(4, 0) = 3.2f;
  const ImageMask people = people_mask(depth, room);
  EXPECT_EQ(people.data, (ImageMask::Values{1, 0, 0, 1, 0}));
}

TEST(Outline, GrowsByColumnsAndRows) {
  EXPECT_EQ(grown(rectangle(100, 70, 3, 2), 40), rectangle(60, 30, 83, 82));
  EXPECT_EQ(grown(rectangle(0, 148, 1, 1), 5), rectangle(0, 143, 6, 7));
  EXPECT_EQ(grown(ImageMask(20, 20), 5), ImageMask(20, 20));
}

TEST(Outline, IsTheRimInsideTheMask) {
  const ImageMask everywhere(200, 150, 1);
  const ImageMask rim = outline_of(rectangle(50, 40, 20, 10), everywhere);
  int count = 0;
  for (const std::uint8_t v : rim.data) count += v;
  EXPECT_EQ(count, 2 * 20 + 2 * 10 - 4);
  // Where the picture or the region ends, there is no outline.
  const ImageMask cut = outline_of(rectangle(0, 0, 20, 150), everywhere);
  for (int y = 0; y < 150; ++y) {
    EXPECT_EQ(*cut.at(0, y), 0);
    EXPECT_EQ(*cut.at(19, y), 1);
  }
  const ImageMask region = rectangle(0, 0, 20, 150);
  EXPECT_EQ(outline_of(rectangle(5, 40, 100, 10), region),
            outline_of(rectangle(5, 40, 15, 10), region));
}

TEST(Outline, DistancesAreThoseOfShiftedAndGrownShapes) {
  const ImageMask everywhere(200, 150, 1);
  const auto between = [&](const ImageMask& a, const ImageMask& b) {
    return mean(outline_distance(outline_of(a, everywhere), outline_of(b, everywhere)));
  };
  const ImageMask shape = rectangle(60, 40, 60, 60);
  EXPECT_EQ(between(shape, shape), 0);
  // Three more pixels on each side: 3 along the sides, up to 3 sqrt 2 in the corners.
  EXPECT_NEAR(between(shape, rectangle(57, 37, 66, 66)), 3, 0.1);
  // A stripe that is shifted along itself: only its ends move.
  EXPECT_EQ(between(rectangle(0, 40, 200, 20), rectangle(0, 44, 200, 20)), 4);
  EXPECT_EQ(between(shape, ImageMask(200, 150)), kOutlineMost_px) << "nobody was drawn";
  const ImageMask left = rectangle(0, 0, 100, 150);
  const OutlineDistance right = outline_distance(
      outline_of(shape, everywhere), outline_of(rectangle(60, 40, 64, 60), everywhere), left);
  EXPECT_GT(mean(right), 1);
  EXPECT_LT(mean(right), 4);
  EXPECT_EQ(mean(outline_distance(outline_of(shape, everywhere),
                                  outline_of(rectangle(60, 40, 64, 60), everywhere),
                                  rectangle(95, 0, 105, 150))),
            0)
      << "the shifted side is left out";
  EXPECT_EQ(between(rectangle(0, 0, 5, 5), rectangle(180, 140, 5, 5)), kOutlineMost_px);
}

TEST(Outline, OfTheTruthIsNoDistanceAndOfAnEmptyRoomTheMost) {
  const SmallScene small(", people: 1");
  synth::Truth truth(*small.scene.rig, small.scene.fps);
  std::vector<render::Viewpoint> views = read_viewpoints(viewpoints_file(small.scene), "")->views;
  const auto outline = [&](Mesh mesh) {
    Chunk chunk;
    chunk.mesh = std::move(mesh);
    DecodedScene shown;
    shown.chunks.push_back(std::make_shared<const Chunk>(std::move(chunk)));
    const auto found = outline_error(small.scene, shown, 2, views);
    if (found) return *found;
    ADD_FAILURE() << found.error().message;
    return std::optional<OutlineError>{};
  };
  const Mesh room = truth.room(), all = truth.surface(2).mesh;
  ASSERT_GT(all.triangles.size(), room.triangles.size());
  EXPECT_LT(outline(all).value().all_px, 0.05);  // another rasteriser, on the same triangles
  EXPECT_GT(outline(room).value().all_px, 19);
  // What no sensor sees and nobody draws does not count as seen.
  const std::vector<SurfaceSample> middles = [&] {
    std::vector<SurfaceSample> out;
    for (std::uint32_t t = 0; t < all.triangles.size(); ++t)
      out.push_back({all.centroid(t), normalized(all.area_normal(t)), t});
    return out;
  }();
  std::vector<std::uint8_t> keep =
      seen_samples(all, middles, sensor_frustums(small.scene), small.scene.voxel_m);
  std::fill_n(keep.begin(), room.triangles.size(), std::uint8_t{1});
  const OutlineError open = outline(select_triangles(all, keep)).value();
  EXPECT_GT(open.all_px, 3 * open.seen_px.value());
  EXPECT_LT(open.seen_px.value(), 1.5);
  EXPECT_GT(outline(room).value().seen_px.value(), 19) << "they can be seen, and are not there";
  // Edges of a room that is drawn up to 3 cm inwards are no people.
  Mesh reaching = all;
  for (std::size_t v = 0; v < room.positions.size(); ++v)
    reaching.positions[v] = reaching.positions[v] * 0.99f;  // up to 3 cm inwards
  const OutlineError wide = outline(reaching).value();
  EXPECT_GT(wide.all_px, 2 * wide.seen_px.value());
  EXPECT_LT(wide.seen_px.value(), 1);
  // Everybody 1 cm fatter: at 2 m that is three pixels.
  Mesh fatter = all;
  const std::size_t first = room.positions.size();
  std::vector<Vec3f> normals(fatter.positions.size());
  for (std::size_t t = room.triangles.size(); t < fatter.triangles.size(); ++t)
    for (const std::uint32_t v : fatter.triangles[t]) normals[v] += fatter.area_normal(t);
  for (std::size_t v = first; v < fatter.positions.size(); ++v)
    fatter.positions[v] += normalized(normals[v]) * 0.01f;
  EXPECT_GT(outline(fatter).value().all_px, 1);
  EXPECT_LT(outline(fatter).value().all_px, 8);
}

TEST(Outline, NothingWithoutPeople) {
  const SmallScene small;
  const auto found = outline_error(small.scene, {}, 0, {});
  ASSERT_TRUE(found);
  EXPECT_EQ(*found, std::nullopt);
}

}  // namespace
}  // namespace mr::eval
