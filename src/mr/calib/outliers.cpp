#include "mr/calib/outliers.h"

#include <utility>

#include "mr/core/assert.h"
#include "mr/kit/disjoint_sets.h"

namespace mr::calib {
namespace {

/// Marks the members of the largest group within each set of parts that overlap; none where two
/// are as large.
std::vector<std::uint8_t> in_largest(kit::DisjointSets& overlap, kit::DisjointSets& groups,
                                     std::size_t parts) {
  std::vector<std::uint32_t> size(parts), largest(parts);
  for (std::uint32_t i = 0; i < parts; ++i) ++size[groups.of(i)];
  std::vector<std::uint32_t> winner(parts, static_cast<std::uint32_t>(parts));
  for (std::uint32_t i = 0; i < parts; ++i) {
    if (groups.of(i) != i) continue;
    const std::uint32_t set = overlap.of(i);
    if (size[i] > largest[set])
      largest[set] = size[i], winner[set] = i;
    else if (size[i] == largest[set])
      winner[set] = static_cast<std::uint32_t>(parts);
  }
  std::vector<std::uint8_t> out(parts);
  for (std::uint32_t i = 0; i < parts; ++i) out[i] = winner[overlap.of(i)] == groups.of(i);
  return out;
}

/// Of the area that each part should share with members, the share where it does not fit them.
std::vector<double> misfits(std::span<const PairResidual> residuals,
                            const std::vector<std::uint8_t>& member, double limit_mm) {
  std::vector<double> all(member.size()), odd(member.size());
  for (const PairResidual& r : residuals)
    for (const auto& [part, other] : {std::pair{r.a, r.b}, std::pair{r.b, r.a}})
      if (member[other]) {
        all[part] += r.expected_m2;
        if (!agree(r, limit_mm)) odd[part] += r.expected_m2;
      }
  for (std::size_t i = 0; i < all.size(); ++i) odd[i] = all[i] > 0 ? odd[i] / all[i] : 0;
  return odd;
}

}  // namespace

std::vector<std::uint32_t> outliers(std::span<const PairResidual> residuals, std::size_t parts,
                                    double limit_mm) {
  kit::DisjointSets overlap(parts), groups(parts);
  for (const PairResidual& r : residuals) {
    MR_ASSERT(r.a < parts && r.b < parts);
    overlap.join(r.a, r.b);
    if (agree(r, limit_mm)) groups.join(r.a, r.b);
  }
  std::vector<std::uint8_t> member = in_largest(overlap, groups, parts);
  std::vector<double> misfit = misfits(residuals, member, limit_mm);
  const auto within = [&](std::size_t i) { return member[i] ? misfit[i] : 0; };
  for (std::size_t round = 0; round < parts; ++round) {  // in the group by chance: out, worst first
    std::size_t worst = 0;
    for (std::size_t i = 1; i < parts; ++i)
      if (within(i) > within(worst)) worst = i;
    if (within(worst) <= 0.5) break;
    member[worst] = 0;
    misfit = misfits(residuals, member, limit_mm);
  }
  std::vector<std::uint32_t> out;
  for (std::uint32_t i = 0; i < parts; ++i)
    if (!member[i] && misfit[i] > 0.5) out.push_back(i);
  return out;
}

}  // namespace mr::calib
