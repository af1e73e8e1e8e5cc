#include "mr/render/gl_program.h"

#include <epoxy/gl.h>

#include <string>

namespace mr::render {
namespace {

constexpr const char* kVertexShader = R"(#version 330 core
layout(location = 0) in vec3 position;  // metres from the eye, along the world's axes
layout(location = 1) in vec3 tint;      // of a background
uniform mat4 T_clip_eye;
uniform mat4 T_view_eye;                // to the camera frame of the texturing view
out vec3 from_eye;
out vec3 in_view;
out vec3 vertex_color;

void main() {
  vertex_color = tint;
  from_eye = position;
  in_view = (T_view_eye * vec4(position, 1)).xyz;
  gl_Position = T_clip_eye * vec4(position, 1);
}
)";

/// paint() comes from kPaintShaders.
constexpr const char* kFragmentShader = R"(#version 330 core
const float kPi = 3.14159265358979;

uniform vec3 color;            // of what has no texture
uniform vec2 view_size;        // camera pixels
uniform vec2 focal, center;    // camera pixels
uniform float tile_middle;     // camera column in the middle of the tile
uniform vec2 scale, offset;    // camera pixel -> texels of the atlas
uniform vec2 tile_low, tile_high;  // half a texel inside the tile
uniform sampler2D picture;

in vec3 from_eye;
in vec3 in_view;
in vec3 vertex_color;
out vec4 pixel;

vec2 project_pinhole(vec3 p) { return focal * p.xy / p.z + center; }

// Columns wrap to the turn whose middle is the tile's.
vec2 project_equirectangular(vec3 p) {
  vec2 turns = vec2(atan(p.x, p.z) / (2.0 * kPi), atan(p.y, length(p.xz)) / kPi);
  vec2 at = (turns + 0.5) * view_size - 0.5;
  at.x = tile_middle + view_size.x * (fract((at.x - tile_middle) / view_size.x + 0.5) - 0.5);
  return at;
}

vec3 texture_at(vec2 camera_pixel) {
  vec2 texel = clamp(camera_pixel * scale + offset, tile_low, tile_high);
  return textureLod(picture, texel / vec2(textureSize(picture, 0)), 0.0).rgb;
}

// Of the flat triangle, towards the eye.
vec3 normal() {
  vec3 n = cross(dFdx(from_eye), dFdy(from_eye));
  float size = length(n);
  if (size == 0.0) return -normalize(from_eye);
  return dot(n, from_eye) > 0.0 ? -n / size : n / size;
}

float headlight(vec3 n) { return 0.35 + 0.65 * abs(dot(n, normalize(from_eye))); }

vec3 paint();
void main() { pixel = vec4(paint(), 1); }
)";

constexpr const char* kPaintShaders[kPaints] = {
    "vec3 paint() { return in_view.z > 1e-6 ? texture_at(project_pinhole(in_view)) : color; }",
    "vec3 paint() { return texture_at(project_equirectangular(in_view)); }",
    "vec3 paint() {\n"
    "  vec3 n = normal();\n"
    "  return gl_FrontFacing ? 0.5 + 0.5 * n : headlight(n) * vec3(0.45, 0.0, 0.0);\n"
    "}",
    "vec3 paint() { return headlight(normal()) * color; }",
    "vec3 paint() { return color; }",
    "vec3 paint() { return vertex_color; }",
};

Result<GLuint> compile(GLenum kind, const std::string& text) {
  const GLuint shader = glCreateShader(kind);
  const char* source = text.c_str();
  glShaderSource(shader, 1, &source, nullptr);
  glCompileShader(shader);
  GLint ok = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
  if (ok) return shader;
  std::string log(4096, '\0');
  GLsizei length = 0;
  glGetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), &length, log.data());
  log.resize(length);
  glDeleteShader(shader);
  return Error{Error::Cause::unsupported, "OpenGL shader does not compile: " + log};
}

}  // namespace

Result<unsigned> make_scene_program(Paint paint) {
  const auto vertex = compile(GL_VERTEX_SHADER, kVertexShader);
  if (!vertex) return vertex.error();
  const auto fragment =
      compile(GL_FRAGMENT_SHADER,
              std::string(kFragmentShader) + kPaintShaders[static_cast<int>(paint)] + "\n");
  if (!fragment) return fragment.error();
  const GLuint program = glCreateProgram();
  for (const GLuint shader : {*vertex, *fragment}) {
    glAttachShader(program, shader);
    glDeleteShader(shader);  // lives as long as the program
  }
  glLinkProgram(program);
  GLint ok = 0;
  glGetProgramiv(program, GL_LINK_STATUS, &ok);
  if (!ok) return Error{Error::Cause::unsupported, "OpenGL program does not link"};
  return program;
}

}  // namespace mr::render
