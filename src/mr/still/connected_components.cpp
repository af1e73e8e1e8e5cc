#include "mr/still/connected_components.h"

#include <algorithm>
#include <cstring>

namespace mr::still {
namespace {

/// Union-find: the index of the first run of a region. While labelling, Run::region is the index of
/// the parent run.
std::uint32_t root_of(std::vector<Run>& runs, std::uint32_t s) {
  while (runs[s].region != s) s = runs[s].region = runs[runs[s].region].region;
  return s;
}

void join(std::vector<Run>& runs, std::uint32_t a, std::uint32_t b) {
  a = root_of(runs, a), b = root_of(runs, b);
  runs[std::max(a, b)].region = std::min(a, b);
}

}  // namespace

int next_set(const std::uint8_t* row, int x, int end) {
  if (x >= end) return end;
  const void* const found = std::memchr(row + x, 1, static_cast<std::size_t>(end - x));
  return found ? static_cast<int>(static_cast<const std::uint8_t*>(found) - row) : end;
}

ConnectedComponents connected_components(const ImageMask& mask) {
  ConnectedComponents out;
  std::vector<Run>& runs = out.runs;
  std::size_t above = 0, above_end = 0;  // range of the runs of the previous row
  for (int y = 0; y < mask.height; ++y) {
    const std::uint8_t* const row = mask.row(y);
    const std::size_t begin = runs.size();
    std::size_t touching = above;
    for (int x = next_set(row, 0, mask.width); x < mask.width; x = next_set(row, x, mask.width)) {
      const int first = x;
      while (x < mask.width && row[x]) ++x;
      const auto place = static_cast<std::uint32_t>(runs.size());
      runs.push_back({y, first, x, place});
      while (touching < above_end && runs[touching].end < first) ++touching;
      for (std::size_t s = touching; s < above_end && runs[s].first <= x; ++s)
        join(runs, place, static_cast<std::uint32_t>(s));
    }
    above = begin, above_end = runs.size();
  }
  std::vector<std::uint32_t> number(runs.size());  // a region's root is its first run
  for (std::uint32_t s = 0; s < runs.size(); ++s) {
    const std::uint32_t root = root_of(runs, s);
    if (root == s)
      number[s] = static_cast<std::uint32_t>(out.pixels.size()), out.pixels.push_back(0);
    number[s] = number[root];
    out.pixels[number[s]] += static_cast<std::uint32_t>(runs[s].end - runs[s].first);
  }
  for (std::uint32_t s = 0; s < runs.size(); ++s) runs[s].region = number[s];
  return out;
}

}  // namespace mr::still
