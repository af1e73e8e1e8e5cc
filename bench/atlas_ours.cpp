#include <algorithm>
#include <map>
#include <memory>
#include <optional>

#include "atlas_contenders.h"
#include "bytes.h"
#include "mr/atlas/color_sampler.h"
#include "mr/atlas/occluders.h"
#include "mr/core/parallel.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

class AtlasOurs final : public Work {
 public:
  AtlasOurs(const AtlasCase& input, int threads)
      : input_(input), arena_(threads), colors_(pictures_of(input), {}) {
    if (!input.still.empty())
      arena_.run([&] { still_.emplace(input_.still, std::span(input_.views)); });
  }

  void clear() override { labelled_ = {}; }
  void run(StageClock&) override {
    const atlas::LabelConfig config{.geometry_error_m = input_.error_m,
                                    .precision = {0.001, 0.0025},
                                    .min_edge_m = 2 * input_.voxel_m,
                                    .occluders = still_ ? &*still_ : nullptr,
                                    .colors = &colors_};
    arena_.run([&] { labelled_ = atlas::label_triangles(input_.surface, input_.views, config); });
  }
  Message result() override {
    std::vector<int> label;
    for (const ViewId id : triangle_views(labelled_)) {
      const auto view = std::ranges::find(input_.views, id, &View::id);
      label.push_back(view == input_.views.end() ? -1
                                                 : static_cast<int>(view - input_.views.begin()));
    }
    return label_message(labelled_, label);
  }

 private:
  static atlas::Pictures pictures_of(const AtlasCase& input) {
    atlas::Pictures out;
    for (std::size_t v = 0; v < input.views.size(); ++v)
      out[input.views[v].stream] = std::make_shared<const ImageRgb>(input.pictures[v]);
    return out;
  }

  const AtlasCase& input_;
  Arena arena_;
  atlas::PictureSampler colors_;
  std::optional<atlas::Occluders> still_;
  Mesh labelled_;
};

}  // namespace

Contender atlas_ours(const AtlasCase& input, int threads) {
  return {"ours", threads, Message::object(),
          [&input, threads] { return std::make_unique<AtlasOurs>(input, threads); }};
}

Message label_message(const Mesh& surface, const std::vector<int>& label) {
  Message out = to_message(surface);
  out["label"] = binary(label);
  return out;
}

}  // namespace mr::bench
