#include "mr/render/scene_buffers.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <utility>

namespace mr::render {
namespace {

template <typename T>
void send(GLenum target, const std::vector<T>& data) {
  glBufferData(target, static_cast<GLsizeiptr>(data.size() * sizeof(T)), data.data(),
               GL_STATIC_DRAW);
}

}  // namespace

void SceneBuffers::set_up() {
  GLuint array = 0;
  glGenVertexArrays(1, &array);
  glBindVertexArray(array);
  for (unsigned* buffer : {&vertices_, &colors_, &indices_}) glGenBuffers(1, buffer);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices_);
  glBindBuffer(GL_ARRAY_BUFFER, vertices_);
  glEnableVertexAttribArray(0);
  glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, sizeof(Vec3f), nullptr);
  glBindBuffer(GL_ARRAY_BUFFER, colors_);
  glVertexAttribPointer(1, 3, GL_UNSIGNED_BYTE, GL_TRUE, 3, nullptr);
}

bool SceneBuffers::holds(const DecodedScene& scene) const {
  return std::equal(chunks_.begin(), chunks_.end(), scene.chunks.begin(), scene.chunks.end(),
                    [](const auto& old, const auto& chunk) { return old.lock() == chunk; });
}

Status SceneBuffers::keep(const DecodedScene& scene) {
  if (holds(scene)) return {};
  chunks_.clear();
  geometry_ = {};
  auto gathered = gather(scene);
  if (!gathered) return gathered.error();
  geometry_ = std::move(*gathered);
  upload();
  chunks_.assign(scene.chunks.begin(), scene.chunks.end());
  return {};
}

void SceneBuffers::upload() {
  send(GL_ELEMENT_ARRAY_BUFFER, geometry_.indices);
  glBindBuffer(GL_ARRAY_BUFFER, vertices_);
  send(GL_ARRAY_BUFFER, geometry_.positions);
  (geometry_.colors.empty() ? glDisableVertexAttribArray : glEnableVertexAttribArray)(1);
  glBindBuffer(GL_ARRAY_BUFFER, colors_);
  send(GL_ARRAY_BUFFER, geometry_.colors);
  geometry_.positions = {};
  geometry_.indices = {};
  geometry_.colors = {};
}

}  // namespace mr::render
