#include <algorithm>
#include <cmath>
#include <memory>
#include <unordered_map>

#include "merge_contenders.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

/// Its corners in an order that no rotation changes.
Triangle turned(const Triangle& t) {
  const auto least = std::ranges::min_element(t) - t.begin();
  return {t[least], t[(least + 1) % 3], t[(least + 2) % 3]};
}

class Clustering final : public Work {
 public:
  explicit Clustering(const MergeCase& input) : input_(input) {}

  void clear() override { merged_ = {}; }
  void run(StageClock&) override { merged_ = cluster_vertices(input_.parts, 2 * input_.voxel_m); }
  Message result() override { return to_message(merged_); }

 private:
  const MergeCase& input_;
  Mesh merged_;
};

}  // namespace

Mesh cluster_vertices(std::span<const kit::Part> parts, double cell_m) {
  Mesh out;
  std::unordered_map<Vec3i, std::uint32_t, CellHash> cells;
  std::vector<float> count;
  for (const kit::Part& part : parts) {
    std::vector<std::uint32_t> cell_of;
    for (const Vec3f p : part.mesh.positions) {
      const auto along = [&](float x) { return static_cast<int>(std::floor(x / cell_m)); };
      const auto next = static_cast<std::uint32_t>(out.positions.size());
      const auto [at, is_new] = cells.try_emplace({along(p.x), along(p.y), along(p.z)}, next);
      if (is_new) out.positions.push_back({}), count.push_back(0);
      out.positions[at->second] += p, ++count[at->second];
      cell_of.push_back(at->second);
    }
    for (const Triangle& t : part.mesh.triangles) {
      const Triangle c{cell_of[t[0]], cell_of[t[1]], cell_of[t[2]]};
      if (c[0] != c[1] && c[1] != c[2] && c[2] != c[0]) out.triangles.push_back(turned(c));
    }
  }
  for (std::size_t i = 0; i < count.size(); ++i) out.positions[i] = out.positions[i] / count[i];
  std::ranges::sort(out.triangles);
  const auto doubled = std::ranges::unique(out.triangles);
  out.triangles.erase(doubled.begin(), doubled.end());
  return out;
}

Contender merge_clustering(const MergeCase& input) {
  return {"clustering", 1, Message::object(),
          [&input] { return std::make_unique<Clustering>(input); }};
}

}  // namespace mr::bench
