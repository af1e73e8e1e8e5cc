#include "mr/still/regions.h"

#include <algorithm>

namespace mr::still {
namespace {

/// Pixels of one row that touch each other.
struct Span {
  int y, first, end;
  std::uint32_t parent;  // place of another span of the same region, its own: the root
};

std::uint32_t root_of(std::vector<Span>& spans, std::uint32_t s) {
  while (spans[s].parent != s) s = spans[s].parent = spans[spans[s].parent].parent;
  return s;
}

void join(std::vector<Span>& spans, std::uint32_t a, std::uint32_t b) {
  a = root_of(spans, a), b = root_of(spans, b);
  spans[std::max(a, b)].parent = std::min(a, b);
}

}  // namespace

Regions connected_regions(const ImageMask& mask) {
  std::vector<Span> spans;
  std::size_t above = 0, above_end = 0;  // the spans of the row before
  for (int y = 0; y < mask.height; ++y) {
    const std::uint8_t* const row = mask.row(y);
    const std::size_t begin = spans.size();
    std::size_t touching = above;
    for (int x = 0; x < mask.width; ++x) {
      if (!row[x]) continue;
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
  Regions out{ImageId(mask.width, mask.height), {0}};
  std::vector<std::uint32_t> number(spans.size());
  for (std::uint32_t s = 0; s < spans.size(); ++s) {
    const std::uint32_t root = root_of(spans, s);
    if (root == s)
      number[s] = static_cast<std::uint32_t>(out.pixels.size()), out.pixels.push_back(0);
    number[s] = number[root];
    out.pixels[number[s]] += static_cast<std::uint32_t>(spans[s].end - spans[s].first);
    std::fill(out.label.at(spans[s].first, spans[s].y),
              out.label.at(spans[s].first, spans[s].y) + (spans[s].end - spans[s].first),
              number[s]);
  }
  return out;
}

}  // namespace mr::still
