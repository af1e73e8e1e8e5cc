#include "mr/eval/rate_sweep.h"

#include <gtest/gtest.h>

#include <cmath>

#include <algorithm>

#include "eval/small_scene.h"
#include "mr/core/parallel.h"
#include "mr/rate/feature_space.h"
#include "mr/rate/swept_surface.h"

namespace mr::eval {
namespace {

rate::Sweep sweep(const Scene& scene, const QualityConfig& config) {
  rate::Sweep out;
  Arena(2).run([&] {
    const auto trial = Trial::prepare(scene, config);
    ASSERT_TRUE(trial) << trial.error().message;
    auto made = sweep_moment(*trial, 0, 4, config);
    ASSERT_TRUE(made) << made.error().message;
    out = *std::move(made);
  });
  return out;
}

/// What holds for a sweep of any scene.
void expect_plausible(const rate::Sweep& sweep) {
  ASSERT_TRUE(rate::is_complete(sweep));
  EXPECT_LE(sweep.qualities.size(), static_cast<std::size_t>(kMostSettings));
  for (const auto& q : sweep.qualities) {
    EXPECT_GT(q.ssim, 0.1);
    EXPECT_LT(q.ssim, 1);
    EXPECT_GT(q.moving_ssim, 0.05);
    EXPECT_LT(q.moving_ssim, 1);
  }
  const rate::GridValues grid = rate::grid_values(sweep);
  EXPECT_GT(grid.geometry_mbps.front(), grid.geometry_mbps.back());
  for (std::size_t t = 1; t < rate::kTextures; ++t) {
    if (rate::kTextureNodes[t].scale != rate::kTextureNodes[t - 1].scale) continue;
    EXPECT_LT(grid.texture_mbps[t], grid.texture_mbps[t - 1]) << "node " << t;
  }
  for (const char* name : rate::feature_names())
    EXPECT_EQ(std::ranges::count(sweep.features, name, &rate::Feature::name), 1) << name;
  for (const int bits : {9, 11})
    EXPECT_EQ(std::ranges::count(sweep.geometries, bits, &rate::Sweep::Geometry::bits), 1);
}

TEST(RateSweep, MeasuresTheSteadyState) {
  const SmallScene small(", frames: 160, people: 1", "still: {layers: true}\n");
  const rate::Sweep made = sweep(small.scene, small.config());
  EXPECT_TRUE(made.layers);
  expect_plausible(made);
  ASSERT_EQ(made.plates.size(), 5u);
  EXPECT_GT(made.plates.front().key_bytes, 2 * made.plates.back().key_bytes);
  EXPECT_GE(made.plates.front().ssim, made.plates.back().ssim);
  ASSERT_EQ(made.stills.size(), 3u);
  EXPECT_GT(made.stills.front().bytes, made.stills.back().bytes);
  // What moves is another part of the picture than what stays.
  for (const auto& q : made.qualities) EXPECT_GT(std::abs(q.moving_ssim - q.ssim), 0.01);
  // The room has been sent: the person is a part of what everything costs.
  EXPECT_LT(made.geometries.front().bytes, made.stills.front().bytes);
}

TEST(RateSweep, MeasuresEverythingSentAnew) {
  const SmallScene small;
  Scene scene = small.scene;
  scene.still.layers = false;
  const rate::Sweep made = sweep(scene, small.config());
  EXPECT_FALSE(made.layers);
  expect_plausible(made);
  EXPECT_TRUE(made.plates.empty() && made.stills.empty());
}

}  // namespace
}  // namespace mr::eval
