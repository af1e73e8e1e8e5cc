#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/decoded_scene.h"
#include "mr/core/image.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"

namespace mr::render {

/// How to draw.
struct RenderOptions {
  std::array<std::uint8_t, 3> background{128, 128, 128};
  std::array<std::uint8_t, 3> no_view{176, 176, 176};  ///< triangles without a view
  bool cull_back_faces = false;
  enum class Shade { texture, normals, views, wireframe } shade = Shade::texture;
};

/// Draws a decoded scene as a client would: every fragment is projected into the view of its
/// triangle's label and its chunk's layer (core/view.h: texturing_view), whose gain it is
/// multiplied by, and a background takes its vertices' colours. OpenGL 3.3 core through EGL,
/// offscreen: the first hardware device, else llvmpipe. Must be used from the thread that made it.
class Renderer {
 public:
  /// unsupported when there is no EGL device or context.
  static Result<Renderer> create();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;
  ~Renderer();

  /// Name of the device that draws.
  std::string device() const;

  /// Draws from a pinhole camera without distortion, or an equirectangular one (of six pinhole
  /// pictures); pixel centres at integers, near plane 5 cm. What a scene's chunks and pictures hold
  /// stays on the card for the next draw, so one scene from many viewpoints is uploaded once.
  /// Points are round and cover at least a pixel. invalid: camera, pose or scene cannot be drawn.
  /// too_large: the device cannot.
  Result<ImageRgb> draw(const DecodedScene& scene, const Camera& camera, const Pose& T_world_camera,
                        const RenderOptions& options = {});

  /// Where the last picture shows a surface. [H, W], 1 there.
  ImageMask covered() const;

 private:
  struct Impl;
  explicit Renderer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// A camera and its pose.
struct Viewpoint {
  std::string name;
  Camera camera;
  Pose T_world_camera;
};

/// Viewpoints for looking at a capture: one from each sensor's colour view (named after the view
/// id), four from outside and above around the scene's box looking at its middle, one from
/// straight above, one from the middle of the sensors looking the way they do on average.
/// `up`: the world's, unit length.
std::vector<Viewpoint> overview(const DecodedScene& scene, Vec3d up, int width = 960,
                                int height = 720);

}  // namespace mr::render
