#include "mr/eval/root_inputs.h"

#include <utility>

namespace mr::eval {

void RootInputs::note(const node::RootAtlas::Drawing& drawing) {
  if (burst.empty()) memory = drawing.atlas.memory();
  burst.push_back({drawing.tick.captures, drawing.tick.views, drawing.tick.sources, drawing.moving,
                   drawing.still ? std::optional(*drawing.still) : std::nullopt, drawing.error_m});
}

void RootInputs::add_moving(const std::vector<std::shared_ptr<const Chunk>>& chunks) {
  for (const auto& chunk : chunks)
    if (chunk->key.id.layer == Layer::moving)
      for (Capture& from : burst) append(from.moving, chunk->mesh);
}

Result<std::vector<node::RootAtlas::Drawn>> RootInputs::draw(const Scene& scene,
                                                             const CodingPlan& plan) const {
  node::RootAtlas atlas(scene);
  atlas.recall(memory);
  std::vector<node::RootAtlas::Drawn> out;
  for (const Capture& from : burst) {
    const node::RootAtlas::Tick tick{from.captures, from.views, from.sources};
    if (from.still && !out.empty()) atlas.update_plates(tick, from.moving);
    auto drawn = atlas.draw(tick, from.moving, from.still ? &*from.still : nullptr, from.error_m,
                            plan, out.size());
    if (!drawn) return drawn.error();
    out.push_back(*std::move(drawn));
  }
  return out;
}

}  // namespace mr::eval
