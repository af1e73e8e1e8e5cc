#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "mr/rate/hull_targets.h"
#include "mr/rate/swept_surface.h"
#include "rate/made_sweeps.h"

namespace mr::rate {
namespace {

constexpr double kScales[] = {1, 0.7, 0.5};

TEST(MadeSweep, IsComplete) {
  for (const Sweep& sweep : made_training()) EXPECT_TRUE(is_complete(sweep)) << sweep.scene;
}

TEST(IsComplete, NotWithoutAnyOneNode) {
  const Sweep sweep = made_sweep();
  for (std::size_t q = 0; q < sweep.qualities.size(); ++q) {
    Sweep without = sweep;
    without.qualities.erase(without.qualities.begin() + static_cast<std::ptrdiff_t>(q));
    const bool is_node = sweep.geometries[sweep.qualities[q].geometry].bits == kBits;
    EXPECT_EQ(is_complete(without), !is_node) << q;
  }
  Sweep other_lattice = sweep;
  other_lattice.geometries[2].bits = 9;
  EXPECT_FALSE(is_complete(other_lattice));
  EXPECT_FALSE(is_complete({}));
}

TEST(RateSurface, IsTheSweepAtItsNodes) {
  for (const Sweep& sweep : made_training()) {
    const RateSurface surface(grid_values(sweep));
    for (const Sweep::Quality& q : sweep.qualities) {
      const Sweep::Geometry& g = sweep.geometries[q.geometry];
      const Sweep::Texture& t = sweep.textures[q.texture];
      const RatePoint p = surface.at({g.error_voxels, g.bits, t.scale, t.qp});
      EXPECT_NEAR(p.mbps, sweep.geometry_mbps(g) + sweep.texture_mbps(t), 1e-9 * p.mbps);
      EXPECT_NEAR(p.ssim, q.ssim, 1e-12);
    }
  }
}

TEST(RateSurface, ALatticeChangesRateAndQualityOfAllSettings) {
  const MadeScene scene;
  const RateSurface surface(grid_values(made_sweep(scene)));
  for (const auto& [bits, rate, ssim] : kMadeLattices)
    for (Setting setting : candidates()) {
      const RatePoint usual = surface.at(setting);
      setting.bits = bits;
      const double geometry = surface.geometry_mbps(setting.error_voxels);
      EXPECT_NEAR(surface.at(setting).mbps, usual.mbps + (rate - 1) * geometry, 1e-9);
      EXPECT_NEAR(surface.at(setting).ssim, usual.ssim + ssim, 1e-9);
    }
}

TEST(RateSurface, LatticesThatWereNotMeasuredAreTheUsualOne) {
  Sweep sweep = made_sweep();
  std::erase_if(sweep.qualities, [](const Sweep::Quality& q) { return q.geometry >= kErrors; });
  const RateSurface surface(grid_values(sweep));
  EXPECT_EQ(surface.at({1, 9, 1, 28}).mbps, surface.at({1, 10, 1, 28}).mbps);
  EXPECT_EQ(surface.at({1, 9, 1, 28}).ssim, surface.at({1, 10, 1, 28}).ssim);
}

TEST(Weighted, IsBetweenTheWholePictureAndWhatMoves) {
  const GridValues values = grid_values(made_sweep());
  EXPECT_EQ(weighted(values, 0).ssim, values.ssim);
  EXPECT_EQ(weighted(values, 1).ssim, values.moving_ssim);
  const GridValues half = weighted(values, 0.5);
  for (std::size_t i = 0; i < half.ssim.size(); ++i)
    EXPECT_NEAR(half.ssim[i], (values.ssim[i] + values.moving_ssim[i]) / 2, 1e-12);
  EXPECT_NEAR(half.lattices[0].ssim, 1.5 * kMadeLattices[0].ssim, 1e-9);
}

TEST(RateSurface, DoesNotDependOnTheOrderOfTheSweep) {
  Sweep sweep = made_sweep();
  std::ranges::reverse(sweep.qualities);
  std::swap(sweep.geometries[0], sweep.geometries[3]);
  for (Sweep::Quality& q : sweep.qualities)
    if (q.geometry % 3 == 0) q.geometry = 3 - q.geometry;
  sweep.geometries.push_back({0.5, 9, 1, 1});
  const RateSurface surface(grid_values(sweep)), other(grid_values(made_sweep()));
  for (const Setting& setting : candidates()) {
    EXPECT_EQ(surface.at(setting).mbps, other.at(setting).mbps);
    EXPECT_EQ(surface.at(setting).ssim, other.at(setting).ssim);
  }
}

TEST(RateSurface, FallsWithQuantiserAndErrorWhereTheSweepDoes) {
  for (const Sweep& sweep : made_training()) {
    const RateSurface surface(grid_values(sweep));
    for (const double scale : kScales)
      for (double error = 0.5; error <= 6; error *= 1.13)
        for (int qp = 19; qp <= 51; ++qp) {
          const RatePoint coarse = surface.at({error, kBits, scale, qp}),
                          fine = surface.at({error, kBits, scale, qp - 1}),
                          fine_mesh = surface.at({error / 1.13, kBits, scale, qp});
          EXPECT_LT(coarse.mbps, fine.mbps);
          EXPECT_LE(coarse.ssim, fine.ssim + 1e-12) << error << ' ' << scale << ' ' << qp;
          EXPECT_LT(coarse.mbps, fine_mesh.mbps);
          EXPECT_LE(coarse.ssim, fine_mesh.ssim + 1e-12) << error << ' ' << scale << ' ' << qp;
        }
  }
}

TEST(RateSurface, IsNearTheSceneBetweenNodes) {
  for (const MadeScene& scene : made_scenes()) {
    const RateSurface surface(grid_values(made_sweep(scene)));
    for (const Setting& s : candidates()) {
      const double geometry = made_geometry_bytes(scene, s.error_voxels) * 30 * 8e-6,
                   texture =
                       made_texture_bytes(scene, s.scale, s.qp) * (29 + scene.key_ratio) * 8e-6;
      EXPECT_NEAR(surface.geometry_mbps(s.error_voxels), geometry, 0.01 * geometry);
      EXPECT_NEAR(surface.texture_mbps(s.scale, s.qp), texture, 1e-9 * texture);
      EXPECT_NEAR(surface.at(s).ssim, made_ssim(scene, s.error_voxels, s.scale, s.qp), 0.01);
    }
  }
}

TEST(RateSurface, OfAPictureThatDoesNotChange) {
  Sweep still = made_sweep();
  for (Sweep::Texture& t : still.textures) t.key_bytes = t.bytes = 0;
  for (Sweep::Geometry& g : still.geometries) g.bytes = 0;
  const RateSurface surface(grid_values(still));
  for (const Setting& s : candidates()) {
    EXPECT_GT(surface.at(s).mbps, 0);
    EXPECT_LT(surface.at(s).mbps, 1e-3);
  }
}

TEST(Candidates, AreTheNodesAndWhatLiesBetween) {
  const std::set<Setting> all(candidates().begin(), candidates().end());
  EXPECT_EQ(all.size(), candidates().size()) << "each once";
  const RateSurface surface(grid_values(made_sweep()));
  EXPECT_EQ(candidate_points(surface).size(), std::size(kLattices) * all.size());
  for (const RatePoint& p : candidate_points(surface)) {
    EXPECT_EQ(surface.at(p.setting).mbps, p.mbps);
    EXPECT_EQ(surface.at(p.setting).ssim, p.ssim);
  }
  for (const double error : {0.5, 1.0, 6.0})
    for (const auto& [scale, qp] : kTextureNodes)
      EXPECT_TRUE(all.contains({error, kBits, scale, qp})) << error << ' ' << scale << ' ' << qp;
  for (int qp = 18; qp <= 45; ++qp) EXPECT_TRUE(all.contains({0.5, kBits, 1, qp})) << qp;
  EXPECT_EQ(candidates().size(), 8u * (28 + 17 + 17));
  EXPECT_TRUE(all.contains(kUsualSetting));
}

TEST(BestWithin, IsTheBestThatFits) {
  const auto points = candidate_points(RateSurface(grid_values(made_sweep())));
  for (const double mbps : log_spaced(0.3, 30, 40)) {
    const RatePoint best = best_within(points, mbps);
    const bool any_fits = std::ranges::any_of(points, [&](auto& p) { return p.mbps <= mbps; });
    for (const RatePoint& p : points)
      if (any_fits)
        EXPECT_FALSE(p.mbps <= mbps && p.ssim > best.ssim) << mbps;
      else
        EXPECT_GE(p.mbps, best.mbps) << mbps;
    EXPECT_EQ(best.mbps <= mbps, any_fits);
  }
}

}  // namespace
}  // namespace mr::rate
