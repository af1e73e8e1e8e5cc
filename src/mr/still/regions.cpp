#include "mr/still/regions.h"

#include <algorithm>
#include <cstring>

namespace mr::still {
namespace {

/// The first span of a region; of each, `region` is the place of another one until all are known.
std::uint32_t root_of(std::vector<Span>& spans, std::uint32_t s) {
  while (spans[s].region != s) s = spans[s].region = spans[spans[s].region].region;
  return s;
}

void join(std::vector<Span>& spans, std::uint32_t a, std::uint32_t b) {
  a = root_of(spans, a), b = root_of(spans, b);
  spans[std::max(a, b)].region = std::min(a, b);
}

}  // namespace

int next_set(const std::uint8_t* row, int x, int end) {
  if (x >= end) return end;
  const void* const found = std::memchr(row + x, 1, static_cast<std::size_t>(end - x));
  return found ? static_cast<int>(static_cast<const std::uint8_t*>(found) - row) : end;
}

Regions connected_regions(const ImageMask& mask) {
  Regions out;
  std::vector<Span>& spans = out.spans;
  std::size_t above = 0, above_end = 0;  // the spans of the row before
  for (int y = 0; y < mask.height; ++y) {
    const std::uint8_t* const row = mask.row(y);
    const std::size_t begin = spans.size();
    std::size_t touching = above;
    for (int x = next_set(row, 0, mask.width); x < mask.width; x = next_set(row, x, mask.width)) {
      const int first = x;
      while (x < mask.width && row[x]) ++x;
      const auto place = static_cast<std::uint32_t>(spans.size());
      spans.push_back({y, first, x, place});
      while (touching < above_end && spans[touching].end < first) ++touching;
      for (std::size_t s = touching; s < above_end && spans[s].first <= x; ++s)
        join(spans, place, static_cast<std::uint32_t>(s));
    }
    above = begin, above_end = spans.size();
  }
  std::vector<std::uint32_t> number(spans.size());  // a root stands before the others
  for (std::uint32_t s = 0; s < spans.size(); ++s) {
    const std::uint32_t root = root_of(spans, s);
    if (root == s)
      number[s] = static_cast<std::uint32_t>(out.pixels.size()), out.pixels.push_back(0);
    number[s] = number[root];
    out.pixels[number[s]] += static_cast<std::uint32_t>(spans[s].end - spans[s].first);
  }
  for (std::uint32_t s = 0; s < spans.size(); ++s) spans[s].region = number[s];
  return out;
}

}  // namespace mr::still
