#include "mr/render/panorama.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace mr::render {
namespace {

/// Pixels of a face's middle, where they are widest, for one of the panorama: resampling then takes
/// little of its sharpness.
constexpr double kDensity = 1.5;
constexpr int kMargin_px = 2;

Mat3 from_columns(Vec3d x, Vec3d y, Vec3d z) {
  return {{x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z}};
}

}  // namespace

PanoramaFaces panorama_faces(const Camera& equirectangular) {
  constexpr double kPi = std::numbers::pi;
  const double pixels_per_rad =
      std::max(equirectangular.width / (2 * kPi), equirectangular.height / kPi);
  PanoramaFaces out;
  Camera& c = out.camera;
  c.fx = c.fy = std::ceil(kDensity * pixels_per_rad);
  c.width = c.height = 2 * (static_cast<int>(c.fx) + kMargin_px);
  c.cx = c.cy = 0.5 * (c.width - 1);
  const Vec3d x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  out.R_camera_face = {from_columns(-z, y, x), from_columns(z, y, -x), from_columns(x, -z, y),
                       from_columns(x, z, -y), from_columns(x, y, z),  from_columns(-x, y, -z)};
  return out;
}

void draw_panorama(unsigned program, const Camera& equirectangular, const PanoramaFaces& faces,
                   const FacesTarget& drawn) {
  glUseProgram(program);
  const auto at = [&](const char* uniform) { return glGetUniformLocation(program, uniform); };
  std::array<float, 9 * FacesTarget::kFaces> rows{};  // a face's axes: the inverse's rows
  for (int face = 0; face < FacesTarget::kFaces; ++face)
    for (int i = 0; i < 9; ++i)
      rows[9 * face + i] = static_cast<float>(transposed(faces.R_camera_face[face]).m[i]);
  glUniformMatrix3fv(at("T_face_camera"), FacesTarget::kFaces, GL_TRUE, rows.data());
  glUniform2f(at("size"), static_cast<float>(equirectangular.width),
              static_cast<float>(equirectangular.height));
  glUniform1f(at("face_focal"), static_cast<float>(faces.camera.fx / faces.camera.width));
  drawn.bind();
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_CULL_FACE);
  glDrawArrays(GL_TRIANGLES, 0, 3);
  glEnable(GL_DEPTH_TEST);
}

}  // namespace mr::render
