#include "scene_input.h"

#include <fmt/format.h>

#include <cstdlib>
#include <stdexcept>
#include <utility>

#include "mr/node/sources.h"

namespace mr::bench {

std::filesystem::path data_folder() {
  if (const char* named = std::getenv("MR_DATA")) return named;
  const std::filesystem::path usual = "../shared/data";
  return std::filesystem::exists(usual) ? usual : std::filesystem::path(MR_SOURCE_DIR) / usual;
}

Scene load_or_throw(const std::filesystem::path& file) {
  SceneResult loaded = load_scene(file);
  if (loaded.problems.size() == 1) throw std::runtime_error(to_string(loaded.problems[0]));
  for (const SceneProblem& problem : loaded.problems)
    fmt::print(stderr, "{}\n", to_string(problem));
  if (!loaded.problems.empty())
    throw std::runtime_error(fmt::format("{} problems in {}; nothing was measured",
                                         loaded.problems.size(), file.string()));
  auto scene = node::prepare_scene(std::move(loaded.scene));
  if (!scene) throw std::runtime_error(scene.error().message);
  return *std::move(scene);
}

}  // namespace mr::bench
