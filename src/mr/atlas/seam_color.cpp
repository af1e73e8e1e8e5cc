#include "mr/atlas/seam_color.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <vector>

#include "mr/atlas/color_sampler.h"
#include "mr/kit/topology.h"

namespace mr::atlas {
namespace {

constexpr double kStep_m = 0.01;

/// A view and its picture.
struct Shown {
  const View* view;
  PicturedView picture;
};

/// Accumulates the colour differences of two views along edges.
class EdgeSteps {
 public:
  EdgeSteps(const ColorSampler& colors, int most_contrast)
      : colors_(colors), most_contrast_(most_contrast) {}

  void add(const Shown& a, const Shown& b, Vec3f from, Vec3f to) {
    const double edge_m = length(to - from);
    const int count = std::max(1, static_cast<int>(std::ceil(std::min(edge_m / kStep_m, 1e4))));
    for (int i = 0; i < count; ++i) {
      const Vec3f p =
          from + (to - from) * ((static_cast<float>(i) + 0.5f) / static_cast<float>(count));
      const auto pixel_a = a.picture.pixel(p), pixel_b = b.picture.pixel(p);
      if (!pixel_a || !pixel_b) continue;
      if (std::max(a.picture.contrast(*pixel_a), b.picture.contrast(*pixel_b)) > most_contrast_)
        continue;
      const auto color_a = colors_.at(*a.view, p), color_b = colors_.at(*b.view, p);
      float most = 0;
      for (int c = 0; c < 3; ++c) most = std::max(most, std::abs((*color_a)[c] - (*color_b)[c]));
      sum_ += most * edge_m / count, length_m_ += edge_m / count;
    }
  }
  double mean() const { return length_m_ > 0 ? sum_ / length_m_ : 0; }

 private:
  const ColorSampler& colors_;
  int most_contrast_;
  double sum_ = 0, length_m_ = 0;
};

}  // namespace

double seam_color_step(const Mesh& mesh, std::span<const View> views, const Pictures& pictures,
                       const ColorCorrections& corrections, int most_contrast) {
  std::map<ViewId, Shown> shown;
  for (const View& view : views)
    if (const auto found = PicturedView::find(view, pictures))
      shown.try_emplace(view.id, Shown{&view, *found});
  const std::vector<ViewId> ids = triangle_views(mesh);
  const std::vector<std::uint32_t> twin = kit::edge_table(mesh).twin;
  const PictureSampler colors(pictures, corrections);
  EdgeSteps steps(colors, most_contrast);
  for (std::uint32_t h = 0; h < twin.size(); ++h) {
    if (twin[h] == kit::kNoTwin || twin[h] < h || ids[h / 3] == ids[twin[h] / 3]) continue;
    const auto a = shown.find(ids[h / 3]), b = shown.find(ids[twin[h] / 3]);
    if (a == shown.end() || b == shown.end()) continue;
    steps.add(a->second, b->second, mesh.positions[kit::edge_from(mesh, h)],
              mesh.positions[kit::edge_to(mesh, h)]);
  }
  return steps.mean();
}

}  // namespace mr::atlas
