// Sweeps and model files of rate control: no crash; models that were read choose valid settings,
// also after having seen what these cost.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "mr/rate/models.h"
#include "mr/rate/swept_surface.h"

namespace {

using namespace mr::rate;

void choose(const Models& models) {
  for (const auto which :
       {RateConfig::Model::classifier, RateConfig::Model::lookup, RateConfig::Model::ours}) {
    const auto model = models.get(which);
    Observation observed;
    for (const double mbps : {0.0, 1.0, 1e9, std::nan("")}) {
      const Setting setting = model->choose(observed, mbps);
      observed.produced.push_back({setting, 1, 2});
      const double share = model->backlog_share(observed, {1e5, 1e5, 1e5, 40, 20}, mbps);
      if (!(share >= kLeastBacklogShare && share < 1)) std::abort();
      observed.bits = setting.bits, observed.moving_weight = 0.5;
      observed.layers = !observed.layers;
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto models = models_from_json(text)) choose(*models);
  if (const auto file = sweeps_from_json(text)) {
    static_cast<void>(to_json(*file));
    for (const Sweep& sweep : file->sweeps)
      if (is_complete(sweep))
        static_cast<void>(candidate_points(RateSurface(weighted(grid_values(sweep), 0.5)))),
            static_cast<void>(loss_of({1e5, 1e5, 1e5, 40, 20}, room_values(sweep), 2));
  }
  return 0;
}
