// Files that eval reads, meshes and stored viewpoints: refused or usable.
#include <cmath>
#include <cstdlib>

#include "in_memory.h"
#include "mr/eval/read_mesh.h"
#include "mr/eval/viewpoints.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const mr::fuzz::InMemoryFile file(data, size);
  if (const auto mesh = mr::eval::read_ply(file.path())) {
    for (const mr::Triangle& triangle : mesh->triangles)
      for (const std::uint32_t vertex : triangle)
        if (vertex >= mesh->positions.size()) std::abort();
  }
  if (const auto plan = mr::eval::read_viewpoints(file.path(), "")) {
    for (const auto& view : plan->views)
      if (!view.camera.problems().empty()) std::abort();
  }
  return 0;
}
