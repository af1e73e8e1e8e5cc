#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"

namespace mr::merge {

/// Where the ray through a pixel meets a triangle.
struct Fragment {
  std::uint32_t triangle = 0;
  float depth_m = 0;    ///< along the camera's z axis
  bool joined = false;  ///< of one surface with the fragment before it
};

/// A multi-layer depth image: all triangles that face a camera, hidden ones too.
struct Layers {
  int width = 0, height = 0;
  Vec3f origin;                      ///< where the rays come from, world frame
  Vec3f corner, right, down;         ///< see ray()
  std::vector<std::uint32_t> first;  ///< [width · height + 1] pixel → its first fragment
  std::vector<Fragment> fragments;   ///< pixel by pixel; drawn with the nearest first

  /// The direction through pixel (x, y), as long as 1 m of depth.
  Vec3f ray(int x, int y) const {
    return corner + right * static_cast<float>(x) + down * static_cast<float>(y);
  }
  std::span<const Fragment> at(int x, int y) const {
    const std::uint32_t* f = &first[static_cast<std::size_t>(y) * width + x];
    return {fragments.data() + f[0], fragments.data() + f[1]};
  }
  std::span<Fragment> at(int x, int y) {
    const std::span<const Fragment> on_ray = std::as_const(*this).at(x, y);
    return {fragments.data() + (on_ray.data() - fragments.data()), on_ray.size()};
  }
};

/// Every meeting of the rays through a camera's pixels with the front of a triangle, from 5 cm
/// depth on. Equal depths are in the order of the triangles. A ray through an edge that two
/// triangles share meets one of them. With `flagged` ([T]): only in the pixels of such triangles.
Layers draw_layers(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera,
                   const std::vector<std::uint8_t>* flagged = nullptr);

/// The same view with `factor` times as many pixels a side.
Camera scaled(const Camera& camera, double factor);

}  // namespace mr::merge
