#include "mr/merge/overlap/cutter.h"

#include <algorithm>
#include <utility>

#include "mr/kit/pair_map.h"

namespace mr::merge {
namespace {

constexpr std::uint32_t kNone = 0xFFFFFFFFu;
constexpr float kSliver = 0.2f;  // of an edge

class Cutter {
 public:
  Cutter(const Mesh& mesh, const std::vector<std::uint8_t>& is_kept, const Crossing& crossing)
      : mesh_(mesh), is_kept_(is_kept), crossing_(crossing), kept_(mesh.positions.size(), kNone) {
    for (; parent_ < mesh.triangles.size(); ++parent_) add(mesh.triangles[parent_]);
  }
  Cut result() && { return std::move(out_); }

 private:
  bool keeps(std::uint32_t v) const { return is_kept_[v] != 0; }

  void add(const Triangle& t) {
    const int kept = keeps(t[0]) + keeps(t[1]) + keeps(t[2]);
    if (kept == 0) return;
    if (kept == 3) return add_triangle(keep(t[0]), keep(t[1]), keep(t[2]));
    int odd = 0;  // the corner that is alone on its side
    while (keeps(t[odd]) != (kept == 1)) ++odd;
    const std::uint32_t a = t[odd], b = t[(odd + 1) % 3], c = t[(odd + 2) % 3];
    if (kept == 1) return add_triangle(keep(a), cross(a, b), cross(a, c));
    const std::uint32_t ab = cross(b, a), ca = cross(c, a), kb = keep(b), kc = keep(c);
    add_triangle(ab, kb, kc);
    add_triangle(ab, kc, ca);
  }

  void add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    if (a == b || b == c || c == a) return;
    out_.mesh.triangles.push_back({a, b, c});
    out_.parent.push_back(parent_);
  }

  std::uint32_t add_vertex(const Cut::Place& place) {
    const Vec3f p = mesh_.positions[place.from], q = mesh_.positions[place.to];
    out_.mesh.positions.push_back(p + (q - p) * place.share);
    out_.places.push_back(place);
    return static_cast<std::uint32_t>(out_.mesh.positions.size() - 1);
  }

  std::uint32_t keep(std::uint32_t v) {
    if (kept_[v] == kNone) kept_[v] = add_vertex({v, v, 0});
    return kept_[v];
  }

  /// The vertex where the edge between a kept and a lost one is cut.
  std::uint32_t cross(std::uint32_t kept, std::uint32_t lost) {
    const std::uint64_t key = static_cast<std::uint64_t>(kept) << 32 | lost;
    if (const std::uint32_t* known = crossings_.find(key)) return *known;
    const float t = crossing_(kept, lost);
    const std::uint32_t vertex = t < kSliver ? keep(kept) : add_vertex({kept, lost, t});
    return crossings_.get_or_add(key, vertex);
  }

  const Mesh& mesh_;
  const std::vector<std::uint8_t>& is_kept_;
  const Crossing& crossing_;
  std::vector<std::uint32_t> kept_;  // [V] in out_
  kit::PairMap crossings_{1024};
  std::uint32_t parent_ = 0;
  Cut out_;
};

}  // namespace

Cut cut_at(const Mesh& mesh, const std::vector<std::uint8_t>& keep, const Crossing& crossing) {
  return Cutter(mesh, keep, crossing).result();
}

}  // namespace mr::merge
