#include "mr/merge/merge_surfaces.h"

#include "mr/merge/islands.h"

namespace mr::merge {

SurfacesConfig surfaces_config(const OverlapConfig& overlap) {
  const double voxel_m = overlap.voxel_m;
  const bool as_paper = overlap.owner == MergeConfig::Owner::paper;
  return {overlap, as_paper ? SecondLayersConfig{.apart_m = 0} : second_layers_config(voxel_m),
          zipper_config(voxel_m), island_area_m2(voxel_m)};
}

Mesh merge_surfaces(std::span<const kit::Part> parts, const SurfacesConfig& config,
                    QualityMemory* memory, const MergeHooks& hooks) {
  const auto step = [&](const char* name, const std::function<void()>& work) {
    hooks.step ? hooks.step(name, work) : work();
  };
  std::vector<Mesh> owned;
  Mesh mesh;
  step("overlap", [&] {
    owned = remove_overlap(parts, config.overlap, memory);
    remove_second_layers(owned, config.second_layers);
  });
  ZipperConfig zipper = config.zipper;
  if (hooks.after_overlap) hooks.after_overlap(owned, zipper);
  step("zipper", [&] { mesh = zip(owned, zipper); });
  step("islands", [&] { mesh = remove_islands(mesh, config.island_area_m2); });
  return mesh;
}

}  // namespace mr::merge
