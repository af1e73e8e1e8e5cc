#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "mr/core/frame.h"
#include "mr/core/result.h"
#include "mr/eval/moments.h"
#include "mr/eval/system.h"
#include "mr/scene/scene.h"

/// Shared pieces of the systems under test.
namespace mr::eval {

/// The scene with the given settings.
Scene with(Scene scene, const GeometrySetting& setting);
Scene with(Scene scene, const TextureSetting& setting);

using Capture = std::vector<Frame>;

/// Reads the captures of a moment's burst on first use and keeps them.
class Bursts {
 public:
  /// The scene must outlive this.
  Bursts(const Scene& scene, Moments moments, std::filesystem::path rig_cache)
      : scene_(&scene), moments_(std::move(moments)), rig_cache_(std::move(rig_cache)) {}

  Result<std::span<const Capture>> at(std::size_t moment);

 private:
  const Scene* scene_;
  Moments moments_;
  std::filesystem::path rig_cache_;
  std::map<std::size_t, std::vector<Capture>> read_;
};

/// MeshReduce's own pipeline as a System.
std::unique_ptr<System> make_meshreduce_system(std::filesystem::path folder, const Scene& scene,
                                               const SystemConfig& config);

}  // namespace mr::eval
