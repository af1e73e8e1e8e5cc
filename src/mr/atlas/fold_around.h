#pragma once

#include <algorithm>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/parallel.h"

namespace mr::atlas {

/// Folds every `window` values that lie `stride` apart into the first of them by doubling (`fold`
/// must be associative, commutative and idempotent, such as min). What lies beyond the last whole
/// window loses its meaning. `spare`: as many values.
template <typename T, typename Fold>
void fold_windows(std::vector<T>& values, std::vector<T>& spare, int window, int stride,
                  const Fold& fold) {
  const auto fold_with_next = [&](int distance) {
    const T* __restrict in = values.data();
    T* __restrict out = spare.data();
    const int count = static_cast<int>(values.size()) - distance;
    for (int i = 0; i < count; ++i) out[i] = fold(in[i], in[i + distance]);
    values.swap(spare);
  };
  int folded = 1;
  for (; 2 * folded <= window; folded *= 2) fold_with_next(folded * stride);
  if (folded < window) fold_with_next((window - folded) * stride);
}

/// Each pixel folded with all that are at most `r` away in x and y; beyond the picture lies
/// `outside`. Parallel.
template <typename T, typename Fold>
Image<T, 1> fold_around(const Image<T, 1>& image, int r, T outside, const Fold& fold) {
  const int window = 2 * r + 1;
  Image<T, 1> rows(image.width, image.height), out(image.width, image.height);
  parallel_for(image.height, 32, [&](std::size_t begin, std::size_t end) {
    std::vector<T> line(image.width + 2 * r), spare(line.size());
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      std::fill(line.begin(), line.end(), outside);
      std::copy_n(image.row(y), image.width, line.begin() + r);
      fold_windows(line, spare, window, 1, fold);
      std::copy_n(line.begin(), image.width, rows.row(y));
    }
  });
  constexpr int kStrip = 64 / sizeof(T);  // columns folded at once: one cache line
  const int strips = (image.width + kStrip - 1) / kStrip;
  parallel_for(strips, 4, [&](std::size_t begin, std::size_t end) {
    std::vector<T> strip((image.height + 2 * r) * kStrip), spare(strip.size());
    for (int x = static_cast<int>(begin) * kStrip; x < static_cast<int>(end) * kStrip;
         x += kStrip) {
      const int columns = std::min(kStrip, image.width - x);
      std::fill(strip.begin(), strip.end(), outside);
      for (int y = 0; y < image.height; ++y)
        std::copy_n(rows.at(x, y), columns, strip.begin() + (y + r) * kStrip);
      fold_windows(strip, spare, window, kStrip, fold);
      for (int y = 0; y < image.height; ++y)
        std::copy_n(strip.begin() + y * kStrip, columns, out.at(x, y));
    }
  });
  return out;
}

}  // namespace mr::atlas
