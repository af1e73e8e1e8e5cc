#include "mr/eval/covered_ssim.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "mr/core/parallel.h"

namespace mr::eval {
namespace {

constexpr int kReach_px = kSsimWindow_px / 2;
constexpr double kMiddleLuma = 128;  // taken off before squaring, for precision

/// What a window sums of its covered pixels: their weight, x, y, xx, yy and xy.
enum CoveredSum { weight_plane, x_plane, y_plane, xx_plane, yy_plane, xy_plane, kSums };
using Sums = std::array<double, kSums>;

std::array<double, kSsimWindow_px> gaussian() {
  std::array<double, kSsimWindow_px> out{};
  for (int k = 0; k < kSsimWindow_px; ++k)
    out[k] = std::exp(-0.5 * (k - kReach_px) * (k - kReach_px) / (kSsimSigma_px * kSsimSigma_px));
  return out;
}

/// [W] the sums over eleven rows, from row `top` on.
void sum_columns(const ImageLuma& test, const ImageLuma& reference, const ImageMask& covered,
                 int top, const std::array<double, kSsimWindow_px>& weights,
                 std::vector<Sums>& out) {
  std::ranges::fill(out, Sums{});
  for (int k = 0; k < kSsimWindow_px; ++k) {
    const float *a = test.row(top + k), *b = reference.row(top + k);
    const std::uint8_t* in = covered.row(top + k);
    for (std::size_t i = 0; i < out.size(); ++i) {
      if (in[i] == 0) continue;
      const double w = weights[k], x = a[i] - kMiddleLuma, y = b[i] - kMiddleLuma;
      const Sums add{w, w * x, w * y, w * x * x, w * y * y, w * x * y};
      for (int p = 0; p < kSums; ++p) out[i][p] += add[p];
    }
  }
}

/// Of one window.
double similarity(const Sums& s) {
  const double mean_x = s[x_plane] / s[weight_plane], mean_y = s[y_plane] / s[weight_plane];
  const double variance_x = s[xx_plane] / s[weight_plane] - mean_x * mean_x;
  const double variance_y = s[yy_plane] / s[weight_plane] - mean_y * mean_y;
  const double covariance = s[xy_plane] / s[weight_plane] - mean_x * mean_y;
  const double level_x = mean_x + kMiddleLuma, level_y = mean_y + kMiddleLuma;
  return (2 * level_x * level_y + kSsimC1) / (level_x * level_x + level_y * level_y + kSsimC1) *
         ((2 * covariance + kSsimC2) / (variance_x + variance_y + kSsimC2));
}

struct RowScore {
  double similarity = 0, squares = 0;
  std::uint64_t windows = 0, pixels = 0;
};

RowScore windows_of_row(const ImageLuma& test, const ImageLuma& reference, const ImageMask& covered,
                        int middle) {
  const std::array<double, kSsimWindow_px> weights = gaussian();
  std::vector<Sums> columns(test.width);
  sum_columns(test, reference, covered, middle - kReach_px, weights, columns);
  RowScore out;
  for (int x = kReach_px; x + kReach_px < test.width; ++x) {
    if (*covered.at(x, middle) == 0) continue;
    Sums sums{};
    for (int k = 0; k < kSsimWindow_px; ++k)
      for (int p = 0; p < kSums; ++p) sums[p] += weights[k] * columns[x - kReach_px + k][p];
    out.similarity += similarity(sums), ++out.windows;
  }
  return out;
}

void add_squares(const ImageLuma& test, const ImageLuma& reference, const ImageMask& covered, int y,
                 RowScore& out) {
  for (int x = 0; x < test.width; ++x) {
    if (*covered.at(x, y) == 0) continue;
    const double difference = double{*test.at(x, y)} - double{*reference.at(x, y)};
    out.squares += difference * difference, ++out.pixels;
  }
}

bool is_finite(const ImageLuma& picture) {
  return std::ranges::all_of(picture.data, [](float v) { return std::isfinite(v); });
}

Status check(const ImageLuma& test, const ImageLuma& reference, const ImageMask& covered) {
  const auto same = [&](const auto& image) {
    return image.width == reference.width && image.height == reference.height;
  };
  const auto invalid = [](const char* why) { return Error{Error::Cause::invalid, why}; };
  if (!same(test) || !same(covered)) return invalid("SSIM of pictures of different sizes");
  if (test.width < kSsimWindow_px || test.height < kSsimWindow_px)
    return invalid("SSIM needs pictures of at least 11x11");
  if (!is_finite(test) || !is_finite(reference))
    return invalid("SSIM of a picture that holds a value that is not finite");
  return {};
}

}  // namespace

Result<CoveredScore> covered_ssim(const ImageLuma& test, const ImageLuma& reference,
                                  const ImageMask& covered) {
  if (const Status ok = check(test, reference, covered); !ok) return ok.error();
  std::vector<RowScore> rows(test.height);
  parallel_for(rows.size(), 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const int y = static_cast<int>(i);
      if (y >= kReach_px && y + kReach_px < test.height)
        rows[i] = windows_of_row(test, reference, covered, y);
      add_squares(test, reference, covered, y, rows[i]);
    }
  });
  RowScore all;
  for (const RowScore& row : rows) {
    all.similarity += row.similarity, all.windows += row.windows;
    all.squares += row.squares, all.pixels += row.pixels;
  }
  CoveredScore out;
  out.windows = all.windows;
  if (all.windows > 0) out.ssim = all.similarity / static_cast<double>(all.windows);
  out.psnr_db =
      all.squares == 0
          ? kSamePsnr_db
          : std::min(kSamePsnr_db, 10 * std::log10(255.0 * 255.0 * static_cast<double>(all.pixels) /
                                                   all.squares));
  return out;
}

}  // namespace mr::eval
