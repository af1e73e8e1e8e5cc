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

/// Options of a draw.
struct RenderOptions {
  std::array<std::uint8_t, 3> background{128, 128, 128};
  std::array<std::uint8_t, 3> no_view{176, 176, 176};  ///< triangles without a view
  bool cull_back_faces = false;
  enum class Shade { texture, normals, views, wireframe } shade = Shade::texture;
};

/// Renders a decoded scene as a client does, by projective texture mapping: every fragment is
/// projected into the view of its triangle's label and its chunk's layer (core/view.h:
/// texturing_view), and its colour multiplied by the view's gain; a background model has vertex
/// colours. Offscreen OpenGL 3.3 core through EGL, on the first hardware device, else llvmpipe.
/// Must be used from the thread that created it.
class Renderer {
 public:
  /// unsupported when there is no EGL device or context.
  static Result<Renderer> create();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;
  ~Renderer();

  /// Name of the device.
  std::string device() const;

  /// Draws from a pinhole camera without distortion, or an equirectangular one (of six pinhole
  /// pictures); pixel centres at integers, near plane 5 cm. Chunks and pictures stay on the
  /// GPU for the next draw, so a scene drawn from many viewpoints is uploaded once.
  /// Points are round and cover at least a pixel. invalid: camera, pose or scene cannot be drawn.
  /// too_large: the device cannot.
  Result<ImageRgb> draw(const DecodedScene& scene, const Camera& camera, const Pose& T_world_camera,
                        const RenderOptions& options = {});

  /// Coverage of the last picture: [H, W], 1 where it shows a surface.
  ImageMask covered() const;

  /// The depth buffer of the last picture, as the device drew it: [H, W] metres along the camera's
  /// z axis, 0 where nothing was drawn; 24 bits of the inverse, so to 3e-5 m at 5 m. unsupported:
  /// there is no picture, it was equirectangular, or the device fails.
  Result<ImageDepth> depth() const;

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

/// Viewpoints that give an overview of a capture: one at each sensor's colour view (named after the
/// view id), four outside and above the scene's bounding box that look at its centre, one from
/// straight above, and one at the sensors' mean position with their mean viewing direction. `up`:
/// of the world, unit length.
std::vector<Viewpoint> overview(const DecodedScene& scene, Vec3d up, int width = 960,
                                int height = 720);

}  // namespace mr::render
