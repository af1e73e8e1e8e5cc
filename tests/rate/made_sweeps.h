#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "mr/rate/grid.h"
#include "mr/rate/observation.h"
#include "mr/rate/sweep.h"
#include "mr/rate/swept_surface.h"

namespace mr::rate {

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN(),
                        kInfinite = std::numeric_limits<double>::infinity();

/// A scene whose rate and quality are known in closed form.
struct MadeScene {
  std::string name = "made";
  bool layers = true;      ///< false: everything is coded anew in each capture
  double moving = 1;       ///< how much moves
  double textured = 1;     ///< how much texture that has
  double per_qp = 0.095;   ///< by how much the logarithm of its bytes falls with the quantiser
  double per_error = 0.3;  ///< and with the logarithm of the error
  double key_ratio = 6;    ///< bytes of a key frame in those of another
  double fps = 30;
};

inline double made_geometry_bytes(const MadeScene& scene, double error_voxels) {
  const double bytes = 4000 * scene.moving * (scene.layers ? 1 : 3);
  return bytes * (0.3 + 0.7 * std::pow(error_voxels / 0.5, -scene.per_error));
}

inline double made_texture_bytes(const MadeScene& scene, double scale, int qp) {
  const double bytes = 9000 * scene.textured * std::sqrt(scene.moving) * (scene.layers ? 1 : 1.8);
  return bytes * std::pow(scale, 1.5) * std::exp(-scene.per_qp * (qp - 28));
}

inline double made_ssim(const MadeScene& scene, double error_voxels, double scale, int qp) {
  return 0.96 - 0.012 * scene.moving * std::log1p(error_voxels) -
         0.01 * scene.textured * (1 / scale - 1) -
         0.003 * scene.textured * (std::exp(0.09 * (qp - 18)) - 1);
}

/// What moves is a part of the picture, which loses more; of meshes above all.
inline double made_moving_ssim(const MadeScene& scene, double error_voxels, double scale, int qp) {
  return made_ssim(scene, error_voxels, scale, qp) - 0.06 * std::log1p(error_voxels);
}

/// The room: plates and still surface.
inline double made_plate_bytes(const MadeScene& scene, int qp) {
  return 2e5 * scene.textured * std::exp(-scene.per_qp * (qp - 28));
}
inline double made_plate_loss(const MadeScene& scene, int qp) {
  return 0.002 * scene.textured * (std::exp(0.1 * (qp - 12)) - 1);
}
inline double made_still_bytes(double error_voxels) { return 2e5 * std::pow(error_voxels, -0.1); }
inline double made_still_loss(double error_voxels) { return 0.008 * std::log(error_voxels / 0.35); }

/// What a lattice takes of the geometry's bytes, and what it adds to quality.
struct MadeLattice {
  int bits = kBits;
  double rate = 1, ssim = 0;
};
inline constexpr MadeLattice kMadeLattices[] = {{9, 0.92, -0.0005}, {11, 1.08, 0.0002}};

/// Of all nodes of the grid, and of the other lattices at one error.
inline Sweep made_sweep(const MadeScene& scene = {}) {
  Sweep out;
  out.scene = scene.name, out.layers = scene.layers, out.fps = scene.fps;
  out.features = {{"color_spatial", 1500 * scene.textured},
                  {"color_temporal", 100 * scene.textured * scene.moving},
                  {"depth_spatial", 20'000 + 3000 * scene.moving},
                  {"depth_temporal", 5000 * scene.moving},
                  {"moving_percent", 2 * scene.moving},
                  {"mask_percent", scene.layers ? 5 * scene.moving : 60},
                  {"triangles", (scene.layers ? 5000 : 20'000) * scene.moving},
                  {"sensors", 4}};
  for (const double error : kErrorNodes_voxels)
    out.geometries.push_back({error, kBits, made_geometry_bytes(scene, error), 1000});
  for (const auto& [scale, qp] : kTextureNodes) {
    const double bytes = made_texture_bytes(scene, scale, qp);
    out.textures.push_back({scale, qp, scene.key_ratio * bytes, bytes});
  }
  for (std::size_t g = 0; g < kErrors; ++g)
    for (std::size_t t = 0; t < kTextures; ++t) {
      const double error = kErrorNodes_voxels[g];
      const auto& [scale, qp] = kTextureNodes[t];
      out.qualities.push_back(
          {g, t, made_ssim(scene, error, scale, qp), made_moving_ssim(scene, error, scale, qp)});
    }
  for (const auto& [bits, rate, ssim] : kMadeLattices) {
    const std::size_t usual = 1, g = out.geometries.size();
    const double error = kErrorNodes_voxels[usual];
    out.geometries.push_back({error, bits, rate * made_geometry_bytes(scene, error), 1000});
    for (const std::size_t t : {2, 7}) {
      const auto& [scale, qp] = kTextureNodes[t];
      out.qualities.push_back({g, t, made_ssim(scene, error, scale, qp) + ssim,
                               made_moving_ssim(scene, error, scale, qp) + 2 * ssim});
    }
  }
  if (!scene.layers) return out;
  const double best = made_ssim(scene, 0.5, 1, 18);
  for (const int qp : kPlateNodes_qp)
    out.plates.push_back({qp, made_plate_bytes(scene, qp), best - made_plate_loss(scene, qp)});
  for (const double error : kStillNodes_voxels)
    out.stills.push_back({error, made_still_bytes(error), best - made_still_loss(error)});
  return out;
}

/// The settings among which rate control chooses, on the grid's lattice.
inline const std::vector<Setting>& candidates() {
  static const std::vector<Setting> all = [] {
    std::vector<Setting> out;
    for (const RatePoint& p : candidate_points(RateSurface(grid_values(made_sweep())), kBits))
      out.push_back(p.setting);
    return out;
  }();
  return all;
}

/// Scenes of a kind that differ in all that a scene can differ in, by name.
inline std::vector<MadeScene> made_scenes(bool layers = true) {
  const std::string kind = layers ? "layers" : "anew";
  return {{"calm " + kind, layers, 0.4, 0.7, 0.09, 0.2, 5},
          {"plain " + kind, layers, 0.8, 0.4, 0.1, 0.35, 6},
          {"usual " + kind, layers, 1, 1, 0.095, 0.3, 6},
          {"busy " + kind, layers, 2.2, 1.2, 0.088, 0.25, 7},
          {"painted " + kind, layers, 0.7, 2.1, 0.105, 0.4, 9},
          {"crowd " + kind, layers, 3.5, 1.6, 0.092, 0.28, 4}};
}

inline std::vector<Sweep> made_sweeps(const std::vector<MadeScene>& scenes) {
  std::vector<Sweep> out;
  for (const MadeScene& scene : scenes) out.push_back(made_sweep(scene));
  return out;
}

/// Sweeps of both kinds.
inline std::vector<Sweep> made_training() {
  std::vector<Sweep> out = made_sweeps(made_scenes());
  for (Sweep& sweep : made_sweeps(made_scenes(false))) out.push_back(std::move(sweep));
  return out;
}

/// What encoders produce of a scene under a setting.
inline Observation::Produced made_produced(const RateSurface& truth, const Setting& setting) {
  return {setting, truth.geometry_mbps(setting.error_voxels),
          truth.texture_mbps(setting.scale, setting.qp)};
}

}  // namespace mr::rate
