#pragma once

#include <algorithm>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/parallel.h"

namespace mr::atlas {

/// A sliding-window reduction by doubling: replaces each value by the reduction of the `window`
/// values from it on, `stride` apart. `op` must be associative, commutative and idempotent, such as
/// min. Values after the last complete window become undefined. `spare`: scratch of the same size.
template <typename T, typename Op>
void reduce_windows(std::vector<T>& values, std::vector<T>& spare, int window, int stride,
                    const Op& op) {
  const auto reduce_with_next = [&](int distance) {
    const T* __restrict in = values.data();
    T* __restrict out = spare.data();
    const int count = static_cast<int>(values.size()) - distance;
    for (int i = 0; i < count; ++i) out[i] = op(in[i], in[i + distance]);
    values.swap(spare);
  };
  int reduced = 1;
  for (; 2 * reduced <= window; reduced *= 2) reduce_with_next(reduced * stride);
  if (reduced < window) reduce_with_next((window - reduced) * stride);
}

/// Reduces each pixel with all that are at most `r` away in x and y; `outside` is the value beyond
/// the picture. With max or `or` this is a morphological dilation by a square, with min an erosion.
/// Parallel.
template <typename T, typename Op>
Image<T, 1> reduce_neighbourhood(const Image<T, 1>& image, int r, T outside, const Op& op) {
  const int window = 2 * r + 1;
  Image<T, 1> rows(image.width, image.height), out(image.width, image.height);
  parallel_for(image.height, 32, [&](std::size_t begin, std::size_t end) {
    std::vector<T> line(image.width + 2 * r), spare(line.size());
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      std::fill(line.begin(), line.end(), outside);
      std::copy_n(image.row(y), image.width, line.begin() + r);
      reduce_windows(line, spare, window, 1, op);
      std::copy_n(line.begin(), image.width, rows.row(y));
    }
  });
  constexpr int kStrip = 64 / sizeof(T);  // columns reduced at once: one cache line
  const int strips = (image.width + kStrip - 1) / kStrip;
  parallel_for(strips, 4, [&](std::size_t begin, std::size_t end) {
    std::vector<T> strip((image.height + 2 * r) * kStrip), spare(strip.size());
    for (int x = static_cast<int>(begin) * kStrip; x < static_cast<int>(end) * kStrip;
         x += kStrip) {
      const int columns = std::min(kStrip, image.width - x);
      std::fill(strip.begin(), strip.end(), outside);
      for (int y = 0; y < image.height; ++y)
        std::copy_n(rows.at(x, y), columns, strip.begin() + (y + r) * kStrip);
      reduce_windows(strip, spare, window, kStrip, op);
      for (int y = 0; y < image.height; ++y)
        std::copy_n(strip.begin() + y * kStrip, columns, out.at(x, y));
    }
  });
  return out;
}

}  // namespace mr::atlas
