#include "mr/simplify/stars.h"

#include <algorithm>
#include <utility>

#include "mr/core/assert.h"

namespace mr::simplify {

Stars::Stars(const Mesh& mesh) : stars_(mesh.positions.size()) {
  pool_.reserve(2 * kLine * stars_.size());
  pool_.resize(kLine * stars_.size());
  for (std::size_t v = 0; v < stars_.size(); ++v)
    stars_[v].first = static_cast<std::uint32_t>(kLine * v);
  for (const auto& [a, b, c] : mesh.triangles) {
    MR_ASSERT(a < stars_.size() && b < stars_.size() && c < stars_.size());
    if (a == b || b == c || c == a) continue;
    add(a, {b, c}), add(b, {c, a}), add(c, {a, b});
    ++triangles_;
  }
}

void Stars::add(std::uint32_t v, Opposite opposite) {
  Star& star = stars_[v];
  if (star.size == star.capacity) grow(star, 2 * star.capacity);
  pool_[star.first + star.size++] = opposite;
}

void Stars::grow(Star& star, std::uint32_t capacity) {
  const auto first = static_cast<std::uint32_t>(pool_.size());
  pool_.resize(pool_.size() + capacity);
  std::copy_n(pool_.begin() + star.first, star.size, pool_.begin() + first);
  star.first = first, star.capacity = capacity;
}

void Stars::plan(std::uint32_t v, std::uint32_t u, Plan& plan) const {
  plan.v = v, plan.u = u;
  unsigned shared = 0, kept = 0;
  for (const Opposite o : of(v)) {
    const bool vanishes = (o.a == u) | (o.b == u);
    plan.apex[shared] = o.a ^ o.b ^ u;
    plan.stays[kept] = o;
    shared += vanishes, kept += !vanishes;
  }
  plan.shared = shared, plan.kept = kept;
}

bool Stars::stays_manifold(const Plan& plan) {
  const auto near_v = of(plan.v), near_u = of(plan.u);
  if (plan.kept == 0 && near_u.size() == plan.shared) return false;  // the last of its part
  // v's neighbours are marked, so that looking them up costs one read.
  round_ += 2;
  const std::uint32_t neighbour = round_, apex = round_ + 1;
  for (const Opposite o : near_v) stars_[o.a].mark = stars_[o.b].mark = neighbour;
  stars_[plan.u].mark = 0;
  for (unsigned i = 0; i < plan.shared; ++i) stars_[plan.apex[i]].mark = apex;
  bool meets = false, closes = false;
  for (const Opposite o : near_u) {
    const std::uint32_t a = stars_[o.a].mark, b = stars_[o.b].mark;
    meets |= (a == neighbour) | (b == neighbour);
    closes |= (a == apex) & (b == apex);
  }
  if (meets) return false;
  return !closes || std::none_of(near_v.begin(), near_v.end(), [&](Opposite o) {
    return stars_[o.a].mark == apex && stars_[o.b].mark == apex;
  });
}

void Stars::rename(std::uint32_t in, std::uint32_t v, std::uint32_t u) {
  // Whole lines, unused places too: no branch depends on the size.
  Opposite* line = pool_.data() + stars_[in].first;
  for (std::uint32_t done = 0; done < stars_[in].capacity; done += kLine, line += kLine)
    for (std::uint32_t i = 0; i < kLine; ++i)
      line[i] = {line[i].a == v ? u : line[i].a, line[i].b == v ? u : line[i].b};
}

void Stars::drop_collapsed(std::uint32_t in) {
  Star& star = stars_[in];
  Opposite* opposite = pool_.data() + star.first;
  std::uint32_t gone = star.size;
  for (std::uint32_t i = 0; i < star.size; ++i) gone = opposite[i].a == opposite[i].b ? i : gone;
  MR_ASSERT(gone < star.size);
  opposite[gone] = opposite[--star.size];
}

void Stars::collapse(const Plan& plan, std::uint32_t end) {
  const auto [v, u] = std::pair(plan.v, plan.u);
  Star& star = stars_[u];
  const std::uint32_t size = star.size - plan.shared + plan.kept;
  if (size > star.capacity) grow(star, (size + kLine - 1) / kLine * kLine);
  Opposite* into = pool_.data() + star.first;
  std::uint32_t n = 0;
  for (std::uint32_t i = 0; i < star.size; ++i) {
    const Opposite o = into[i];
    into[n] = o;
    n += (o.a != v) & (o.b != v);
  }
  for (unsigned i = 0; i < plan.kept; ++i) {
    into[n++] = plan.stays[i];
    rename(plan.stays[i].a, v, u);
  }
  star.size = n;
  for (unsigned i = 0; i < plan.shared; ++i) {
    rename(plan.apex[i], v, u);
    drop_collapsed(plan.apex[i]);
  }
  if (end != u) rename(end, v, u);
  stars_[v].size = 0;
  triangles_ -= plan.shared;
}

}  // namespace mr::simplify
