#include "mr/eval/sweep.h"

#include <gtest/gtest.h>

#include "core/temp_dir.h"
#include "mr/eval/operating_point.h"
#include "support/meshes.h"

namespace mr::eval {
namespace {

constexpr int kWidth = 64, kHeight = 48;

Camera camera() {
  Camera c;
  c.width = kWidth, c.height = kHeight;
  c.fx = c.fy = 40;
  c.cx = (kWidth - 1) / 2.0, c.cy = (kHeight - 1) / 2.0;
  return c;
}

View front_view() {
  const Camera c = camera();
  View view;
  view.width = c.width, view.height = c.height;
  view.fx = c.fx, view.fy = c.fy, view.cx = c.cx, view.cy = c.cy;
  view.image_rect = view.atlas_rect = {0, 0, c.width, c.height};
  return view;
}

/// A picture that gets coarser with the quantiser.
ImageRgb picture(int qp) {
  ImageRgb image(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x)
      for (int c = 0; c < 3; ++c)
        image.at(x, y)[c] = static_cast<std::uint8_t>((x * 7 + y * 13) % 200 / (1 + qp) * (1 + qp));
  return image;
}

/// A wall 2 m ahead of the view; a smaller one with a smaller ratio.
Mesh wall(double ratio) {
  const auto r = static_cast<float>(2 * ratio);
  Mesh mesh;
  mesh.positions = {{-r, -r, 2}, {r, -r, 2}, {r, r, 2}, {-r, r, 2}};
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}};
  mesh.views = {{0, 2, ViewId{0}}};
  return mesh;
}

/// Codes nothing but what it was asked for, and counts how often.
class FakeSystem final : public System {
 public:
  explicit FakeSystem(std::filesystem::path folder) : System(std::move(folder)) {}
  std::string name() const override { return "fake"; }
  int encoded = 0, textures_decoded = 0;
  double fails_at_ratio = 0;  ///< as if interrupted there

 private:
  Result<std::vector<Bytes>> encode(const GeometrySetting& setting, std::size_t) override {
    if (setting.ratio == fails_at_ratio) return Error{Error::Cause::io, "interrupted"};
    ++encoded;
    return std::vector<Bytes>{Bytes(1000)};
  }
  Result<std::vector<Bytes>> encode(const TextureSetting& setting, std::size_t) override {
    ++encoded;
    return std::vector<Bytes>{Bytes(500), Bytes(static_cast<std::size_t>(100 / (1 + setting.qp)))};
  }
  Result<baseline::Geometry> decode(const GeometrySetting& setting,
                                    const std::vector<Bytes>&) override {
    Chunk chunk;
    chunk.mesh = wall(setting.ratio);
    return baseline::Geometry{{std::make_shared<const Chunk>(chunk)}, {front_view()}, {}};
  }
  Result<baseline::Texture> decode(const TextureSetting& setting, std::size_t,
                                   const std::vector<Bytes>&) override {
    ++textures_decoded;
    return baseline::Texture{
        {front_view()}, {{StreamId{0}, std::make_shared<const ImageRgb>(picture(setting.qp))}}};
  }
};

SweepPlan plan() {
  SweepPlan plan;
  plan.geometries = {{0.01, 1, -10, 16}, {0.01, 0.3, -10, 16}};
  plan.textures = {{1, 0}, {1, 30}};
  return plan;
}

SweepReference references() {
  SweepReference out;
  out.views = {{"front", camera(), {}}};
  out.moments = {0};
  const RenderedView reference{picture(0), ImageMask(kWidth, kHeight, 1)};
  EXPECT_TRUE(out.by_divider.emplace_back().add({{reference}}).ok());
  return out;
}

TEST(Sweep, CombinesHalvesThatWereCodedOnce) {
  FakeSystem system({});
  const auto points = sweep(system, plan(), references(), 30, Store({}));
  ASSERT_TRUE(points.ok()) << points.error().message;
  ASSERT_EQ(points->size(), 4u);
  EXPECT_EQ(system.encoded, 4);
  const SweepPoint &best = (*points)[0], &coarse = (*points)[1], &small = (*points)[2];
  EXPECT_GT(best.score.masked.mean, 0.999);  // shown as it is
  EXPECT_LT(coarse.score.masked.mean, 0.95);
  EXPECT_LT(small.score.masked.mean, 0.95);
  EXPECT_EQ(best.triangles, 2u);
  EXPECT_NEAR(best.geometry_mbps, 30 * 1000 * 8e-6, 1e-9);
  EXPECT_NEAR(best.texture_mbps, (500 + 29 * 100) * 8e-6, 1e-9);
  EXPECT_NEAR(coarse.texture_mbps, (500 + 29 * 3) * 8e-6, 1e-9);
}

TEST(Sweep, GoesOnWhereItWasInterrupted) {
  const test::TempDir folder;
  const Store scores(folder.path() / "scores");
  FakeSystem whole({});
  const auto expected = sweep(whole, plan(), references(), 30, Store({}));
  FakeSystem interrupted(folder.path() / "coded");
  interrupted.fails_at_ratio = 0.3;
  EXPECT_FALSE(sweep(interrupted, plan(), references(), 30, scores).ok());
  FakeSystem resumed(folder.path() / "coded");
  const auto points = sweep(resumed, plan(), references(), 30, scores);
  ASSERT_TRUE(points.ok() && expected.ok());
  EXPECT_EQ(resumed.encoded, 1);  // the geometry that was not reached
  for (std::size_t i = 0; i < points->size(); ++i) {
    EXPECT_EQ((*points)[i].mbps(), (*expected)[i].mbps());
    EXPECT_EQ((*points)[i].score.masked.mean, (*expected)[i].score.masked.mean);
  }
  FakeSystem done(folder.path() / "coded");
  ASSERT_TRUE(sweep(done, plan(), references(), 30, scores).ok());
  EXPECT_EQ(done.encoded, 0);
  EXPECT_EQ(done.textures_decoded, 0);  // all scores are kept
}

SweepPoint point(double mbps, double ssim) {
  SweepPoint p;
  p.geometry_mbps = mbps;
  p.score.masked.mean = ssim;
  return p;
}

TEST(OperatingPoint, TakesThePointWhereTheTargetIsJustMet) {
  const std::vector<SweepPoint> points =
      pareto_front({point(4, 0.9), point(1, 0.5), point(3, 0.6), point(2, 0.8), point(9, 0.85)});
  ASSERT_EQ(points.size(), 3u);  // 1, 2, 4: no other has more for less
  const auto at = [&](std::optional<double> mbps, std::optional<double> ssim) {
    return points[crossing(points, {mbps, ssim})].mbps();
  };
  EXPECT_EQ(at(3.5, {}), 2);
  EXPECT_EQ(at(4, {}), 4);
  EXPECT_EQ(at(100, {}), 4);
  EXPECT_EQ(at(0.5, {}), 1);  // met nowhere: the nearest
  EXPECT_EQ(at({}, 0.55), 2);
  EXPECT_EQ(at({}, 0.5), 1);
  EXPECT_EQ(at({}, 0.99), 4);
}

}  // namespace
}  // namespace mr::eval
