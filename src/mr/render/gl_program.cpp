#include "mr/render/gl_program.h"

#include <epoxy/gl.h>

#include <string>

namespace mr::render {
namespace {

constexpr const char* kVersion = "#version 330 core\n";

constexpr const char* kVertexShader = R"(
layout(location = 0) in vec3 position;  // metres from the scene's origin, along the world's axes
layout(location = 1) in vec3 tint;      // where vertices have colours
uniform vec3 eye, eye_rest;             // its place, as the sum of two
uniform mat4 T_clip_eye;
uniform mat4 T_view_eye;                // to the camera of the texturing view
out vec3 from_eye;
out vec3 in_view;
out vec3 vertex_color;

#ifdef POINTS
uniform int first_point;                // vertex
uniform float radius_m, least_radius;   // least: of a metre of distance
out vec2 on_disc;

// A point is a disc that faces the eye, inside a triangle.
const vec2 kCorners[3] = vec2[](vec2(-1.7320509, -1), vec2(1.7320509, -1), vec2(0, 2));

vec3 corner_of_disc(vec3 middle) {
  float far = length(middle);
  vec3 ahead = far > 0.0 ? middle / far : vec3(0, 0, 1);
  vec3 right = normalize(cross(ahead, abs(ahead.z) < 0.8 ? vec3(0, 0, 1) : vec3(1, 0, 0)));
  on_disc = kCorners[(gl_VertexID - first_point) % 3];
  return middle + max(radius_m, least_radius * far) *
                      (on_disc.x * right + on_disc.y * cross(right, ahead));
}
#endif

void main() {
  vertex_color = tint;
  from_eye = (position - eye) - eye_rest;
#ifdef POINTS
  from_eye = corner_of_disc(from_eye);
#endif
  in_view = (T_view_eye * vec4(from_eye, 1)).xyz;
  gl_Position = T_clip_eye * vec4(from_eye, 1);
}
)";

/// paint() comes from kPaintShaders.
constexpr const char* kFragmentShader = R"(
const float kPi = 3.14159265358979;

uniform vec3 color;                // of what has no texture
uniform vec2 view_size;            // camera pixels
uniform float tile_middle;         // camera column in the middle of the tile
uniform vec2 scale, offset;        // camera pixel -> picture's coordinates, 0..1
uniform vec2 tile_low, tile_high;  // half a texel inside the tile; 0..1
uniform float far_side;            // texels per 1 across the picture where the tile is a whole turn
uniform vec3 gain;                 // on what the picture shows
uniform sampler2D picture;

in vec3 from_eye;
in vec3 in_view;
in vec3 vertex_color;
#ifdef POINTS
in vec2 on_disc;
#endif
out vec4 pixel;

vec3 picture_at(vec2 at) { return textureLod(picture, at, 0.0).rgb; }

// `at` times its depth comes from T_view_eye.
vec3 texture_at_pinhole(vec3 p) { return picture_at(clamp(p.xy / p.z, tile_low, tile_high)); }

// Columns wrap to the turn whose middle is the tile's. Where the tile is the whole turn without a
// column of the far side beside it, its first and last columns are neighbours.
vec3 texture_at_equirectangular(vec3 p) {
  vec2 turns = vec2(atan(p.x, p.z) / (2.0 * kPi), atan(p.y, length(p.xz)) / kPi);
  vec2 at = (turns + 0.5) * view_size - 0.5;
  at.x = tile_middle + view_size.x * (fract((at.x - tile_middle) / view_size.x + 0.5) - 0.5);
  at = at * scale + offset;
  vec2 near = clamp(at, tile_low, tile_high);
  vec2 far = vec2(at.x < near.x ? tile_high.x : tile_low.x, near.y);
  return mix(picture_at(near), picture_at(far), far_side * abs(at.x - near.x));
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
void main() {
#ifdef POINTS
  if (dot(on_disc, on_disc) > 1.0) discard;
#endif
  pixel = vec4(paint(), 1);
}
)";

constexpr const char* kPaintShaders[kShadingModes] = {
    "vec3 paint() {\n"
    "  return in_view.z > 1e-6 ? min(gain * texture_at_pinhole(in_view), 1.0) : color;\n"
    "}",
    "vec3 paint() {\n"
    "  if (in_view.z <= 1e-6) return color;\n"
    "  vec2 at = clamp(in_view.xy / in_view.z, tile_low, tile_high);\n"
    "  if (textureLod(picture, at, 0.0).a < 0.5) discard;\n"
    "  return min(gain * picture_at(at), 1.0);\n"
    "}",
    "vec3 paint() { return min(gain * texture_at_equirectangular(in_view), 1.0); }",
    "vec3 paint() {\n"
    "  vec3 n = normal();\n"
    "  return gl_FrontFacing ? 0.5 + 0.5 * n : headlight(n) * vec3(0.45, 0.0, 0.0);\n"
    "}",
    "vec3 paint() { return headlight(normal()) * color; }",
    "vec3 paint() { return color; }",
    "vec3 paint() { return vertex_color; }",
};

/// One triangle that covers the picture.
constexpr const char* kPanoramaVertexShader = R"(
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1, 0, 1); }
)";

/// The direction of each pixel is unproject() of core/camera.h.
constexpr const char* kPanoramaFragmentShader = R"(
const float kPi = 3.14159265358979;

uniform vec2 size;                // pixels
uniform mat3 T_face_camera[6];
uniform float face_focal;         // of the width of a face
uniform sampler2DArray faces;     // right, left, down, up, front, back
out vec4 pixel;

void main() {
  vec2 angle = (gl_FragCoord.xy / size - 0.5) * vec2(2.0 * kPi, kPi);
  vec3 ray = vec3(cos(angle.y) * sin(angle.x), sin(angle.y), cos(angle.y) * cos(angle.x));
  vec3 along = abs(ray);
  int axis = along.z >= along.x && along.z >= along.y ? 2 : along.x >= along.y ? 0 : 1;
  int face = 2 * axis + (ray[axis] < 0.0 ? 1 : 0);
  vec3 p = T_face_camera[face] * ray;
  pixel = textureLod(faces, vec3(face_focal * p.xy / p.z + 0.5, face), 0.0);
}
)";

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

Result<unsigned> link(const std::string& vertex_text, const std::string& fragment_text) {
  const auto vertex = compile(GL_VERTEX_SHADER, vertex_text);
  if (!vertex) return vertex.error();
  const auto fragment = compile(GL_FRAGMENT_SHADER, fragment_text);
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

}  // namespace

Result<unsigned> make_scene_program(ShadingMode paint, bool points) {
  const std::string head = std::string(kVersion) + (points ? "#define POINTS\n" : "");
  return link(head + kVertexShader,
              head + kFragmentShader + kPaintShaders[static_cast<int>(paint)] + "\n");
}

Result<unsigned> make_panorama_program() {
  return link(std::string(kVersion) + kPanoramaVertexShader,
              std::string(kVersion) + kPanoramaFragmentShader);
}

}  // namespace mr::render
