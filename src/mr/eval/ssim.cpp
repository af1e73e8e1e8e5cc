#include "mr/eval/ssim.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>

#include "mr/core/parallel.h"

namespace mr::eval {
namespace {

constexpr int kWindow = kSsimWindow_px, kRadius = kWindow / 2;
constexpr float kMiddle = 128;  // taken off before squaring, so that floats keep their precision
constexpr int kBandRows = 96;
constexpr float kLargestLuma =
    1e5f;  // luma beyond it is a mistake, and floats would not hold its square
constexpr const char* kNotLuma = " holds a value that is not finite or far from 0..255";

/// As many numbers as fit into 16 bytes.
template <typename T>
struct Lanes {
  using Wide [[gnu::vector_size(16)]] = T;
  static constexpr int kCount = 16 / sizeof(T);

  static Wide load(const T* from) {
    Wide v;
    std::memcpy(&v, from, sizeof v);
    return v;
  }
  static void store(Wide v, T* to) { std::memcpy(to, &v, sizeof v); }
};
using Float4 = Lanes<float>::Wide;

int rounded_up(int count, int step) { return (count + step - 1) / step * step; }

/// One side of the window, from the middle outwards: [0] the middle, [k] both pixels k away. In
/// every lane.
template <typename T>
struct Weights {
  typename Lanes<T>::Wide w[kRadius + 1];

  Weights() {
    double values[kRadius + 1], sum = 0;
    for (int k = 0; k <= kRadius; ++k) {
      values[k] = std::exp(-0.5 * k * k / (kSsimSigma_px * kSsimSigma_px));
      sum += k == 0 ? values[k] : 2 * values[k];
    }
    for (int k = 0; k <= kRadius; ++k)
      w[k] = typename Lanes<T>::Wide{} + static_cast<T>(values[k] / sum);
  }

  /// Sum over a window whose k-th lanes are at(k), 0 <= k < 11. Spelled out: g++ -O2 does not
  /// unroll.
  template <typename At>
  typename Lanes<T>::Wide sum(const At& at) const {
    return (at(5) * w[0] + (at(4) + at(6)) * w[1]) +
           ((at(3) + at(7)) * w[2] + (at(2) + at(8)) * w[3]) +
           ((at(1) + at(9)) * w[4] + (at(0) + at(10)) * w[5]);
  }
};

/// Slides over the rows of `kPlanes` planes and keeps the last eleven, filtered along the row.
template <typename T, int kPlanes>
class Window {
 public:
  /// `width`: of the filtered rows.
  explicit Window(int width)
      : width_(rounded_up(width, Lanes<T>::kCount)),
        input_(rounded_up(width_ + kWindow, Lanes<T>::kCount)),
        rows_(static_cast<std::size_t>(kWindow) * kPlanes * width_),
        row_(static_cast<std::size_t>(kPlanes) * input_) {}

  /// Where a plane's next row goes: width + 10 numbers.
  T* input(int plane) { return row_.data() + plane * input_; }

  void push() {
    const Weights<T> weights = weights_;  // a copy that stores cannot change: stays in registers
    T* const to = rows_.data() + static_cast<std::size_t>(next_) * kPlanes * width_;
    for (int plane = 0; plane < kPlanes; ++plane) {
      const T* const from = input(plane);
      for (int x = 0; x < width_; x += Lanes<T>::kCount)
        Lanes<T>::store(weights.sum([&](int k) { return Lanes<T>::load(from + x + k); }),
                        to + plane * width_ + x);
    }
    next_ = (next_ + 1) % kWindow;
    for (int k = 0; k < kWindow; ++k)
      ordered_[k] =
          rows_.data() + static_cast<std::size_t>((next_ + k) % kWindow) * kPlanes * width_;
  }

  /// A plane under the window whose first pixels are x, x + 1, … of the row pushed ten rows ago.
  typename Lanes<T>::Wide sum(int plane, int x) const {
    const std::size_t at = static_cast<std::size_t>(plane) * width_ + x;
    return weights_.sum([&](int k) { return Lanes<T>::load(ordered_[k] + at); });
  }

 private:
  Weights<T> weights_;
  int width_, input_, next_ = 0;
  std::vector<T> rows_, row_;
  std::array<const T*, kWindow> ordered_{};
};

// --- pixel by pixel

/// Squared differences over the pixels of interest, and the largest value of the tested picture
/// (kLargestLuma where one is not a number or beyond it).
struct Difference {
  double squares = 0;
  std::int64_t pixels = 0;
  float largest = 0;
};

Difference difference_of_row(const float* test, const float* reference, const std::uint8_t* mask,
                             int width) {
  Difference out;
  std::array<double, 4> squares{};
  for (int x = 0; x < width; ++x) {
    const float d = test[x] - reference[x], counts = mask == nullptr || mask[x] != 0 ? 1.0f : 0.0f;
    squares[x % 4] += d * d * counts;
    out.pixels += counts != 0;
    const float size = std::abs(test[x]);
    if (!(size <= out.largest)) out.largest = size < kLargestLuma ? size : kLargestLuma;
  }
  out.squares = (squares[0] + squares[1]) + (squares[2] + squares[3]);
  return out;
}

Difference difference(const ImageLuma& test, const ImageLuma& reference, const ImageMask& mask) {
  std::vector<Difference> rows(test.height);
  parallel_for(rows.size(), kBandRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const int y = static_cast<int>(i);
      rows[i] = difference_of_row(test.row(y), reference.row(y),
                                  mask.empty() ? nullptr : mask.row(y), test.width);
    }
  });
  Difference all;
  for (const Difference& row : rows) {
    all.squares += row.squares, all.pixels += row.pixels;
    all.largest = std::max(all.largest, row.largest);
  }
  return all;
}

double psnr_db(const Difference& d) {
  if (d.squares == 0 || d.pixels == 0) return kSamePsnr_db;
  const double mean = d.squares / static_cast<double>(d.pixels);
  return std::min(kSamePsnr_db, 10 * std::log10(255.0 * 255.0 / mean));
}

// --- the mask under the windows

/// Which windows of a row hold a pixel of interest: 1 where one does, 0 elsewhere; all without a
/// mask.
class MaskWindow {
 public:
  /// `windows`: in a row; what follows up to `padded` counts as 0.
  MaskWindow(const ImageMask& mask, int windows, int padded)
      : mask_(mask), columns_(mask.width), touched_(padded) {
    if (mask.empty()) std::fill(touched_.begin(), touched_.begin() + windows, 1.0f);
  }

  /// Rows [y, y + 11) of the mask; y must grow by one from call to call.
  const float* at(int y) {
    if (mask_.empty()) return touched_.data();
    if (next_ == 0) next_ = y;
    for (; next_ < y + kWindow; ++next_) add(next_, 1);
    if (y > first_ && first_ >= 0) add(y - 1, -1);
    first_ = y;
    int covered = 0;  // columns of interest under the window
    for (int x = 0; x < mask_.width; ++x) {
      covered += columns_[x] != 0;
      if (x >= kWindow) covered -= columns_[x - kWindow] != 0;
      if (x >= kWindow - 1) touched_[x - kWindow + 1] = covered > 0 ? 1.0f : 0.0f;
    }
    return touched_.data();
  }

 private:
  void add(int y, int change) {
    const std::uint8_t* const row = mask_.row(y);
    for (int x = 0; x < mask_.width; ++x)
      columns_[x] = static_cast<std::uint8_t>(columns_[x] + (row[x] != 0 ? change : 0));
  }

  const ImageMask& mask_;
  int next_ = 0, first_ = -1;
  std::vector<std::uint8_t> columns_;  ///< [W] how many of the eleven rows are of interest
  std::vector<float> touched_;         ///< [padded]
};

// --- similarity

/// What the windows of one row or of all rows add up to.
struct Sum {
  double full = 0, masked = 0;
  std::int64_t masked_windows = 0;
};

/// The planes that the test picture needs, of its difference d to the reference y: d, d², d y.
enum Plane { difference_plane, square_plane, product_plane, kPlanes };
using TestWindow = Window<float, kPlanes>;

void push_row(TestWindow& window, const float* test, const float* reference, int width) {
  float* const d = window.input(difference_plane);
  float* const dd = window.input(square_plane);
  float* const dy = window.input(product_plane);
  const auto at = [&](int x, auto load, auto store) {
    const auto y = load(reference + x), delta = load(test + x) - y;
    store(delta, d + x), store(delta * delta, dd + x), store(delta * (y - kMiddle), dy + x);
  };
  int x = 0;
  for (; x + 4 <= width; x += 4) at(x, Lanes<float>::load, Lanes<float>::store);
  for (; x < width; ++x)
    at(
        x, [](const float* from) { return *from; }, [](float v, float* to) { *to = v; });
}

/// Similarity of four windows. With x = y + d the two factors of the definition,
/// (2 mx my + C1) / (mx² + my² + C1) and (2 cov + C2) / (var x + var y + C2), are
/// 1 - md² / (mx² + my² + C1) and 1 - var d / (var x + var y + C2): exactly 1 for equal pictures,
/// and precise where both are flat.
Float4 similarity(const TestWindow& window, int x, Float4 mean_y, Float4 variance_y) {
  constexpr auto kLuminance = static_cast<float>(kSsimC1), kContrast = static_cast<float>(kSsimC2);
  const Float4 mean_d = window.sum(difference_plane, x);
  const Float4 variance_d = window.sum(square_plane, x) - mean_d * mean_d;
  const Float4 covariance =
      window.sum(product_plane, x) - mean_d * (mean_y - kMiddle);  // of d and y
  const Float4 mean_x = mean_y + mean_d;
  const Float4 means = mean_x * mean_x + mean_y * mean_y + kLuminance;
  const Float4 variances =
      variance_y + variance_y + covariance + covariance + variance_d + kContrast;
  return (means - mean_d * mean_d) * (variances - variance_d) / (means * variances);
}

using Double4 [[gnu::vector_size(32)]] = double;

double total(const Double4& v) { return (v[0] + v[1]) + (v[2] + v[3]); }

/// A row of windows; `inside` and `counts`: [width] 1 where a window counts for full and masked.
Sum sum_of_row(const TestWindow& window, const float* mean_y, const float* variance_y,
               const float* inside, const float* counts, int width) {
  Double4 full{}, masked{};
  Float4 windows{};
  for (int x = 0; x < width; x += 4) {
    const Float4 s =
        similarity(window, x, Lanes<float>::load(mean_y + x), Lanes<float>::load(variance_y + x));
    const Float4 of_interest = Lanes<float>::load(counts + x);
    full += __builtin_convertvector(s * Lanes<float>::load(inside + x), Double4);
    masked += __builtin_convertvector(s * of_interest, Double4);
    windows += of_interest;
  }
  const Double4 count = __builtin_convertvector(windows, Double4);
  return {total(full), total(masked), static_cast<std::int64_t>(total(count))};
}

Error invalid(const std::string& why) { return {Error::Cause::invalid, why}; }

std::string size_of(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

/// Calls rows(first, end) on bands of the rows of windows.
template <typename Rows>
void for_bands(int height, const Rows& rows) {
  const int bands = (height + kBandRows - 1) / kBandRows;
  parallel_for(bands, 1, [&](std::size_t begin, std::size_t end) {
    for (int b = static_cast<int>(begin); b < static_cast<int>(end); ++b)
      rows(b * kBandRows, std::min((b + 1) * kBandRows, height));
  });
}

}  // namespace

ImageLuma luma_of(const ImageRgb& picture) {
  ImageLuma out(picture.width, picture.height);
  parallel_for(out.data.size(), 16384, [&](std::size_t begin, std::size_t end) {
    const std::uint8_t* rgb = picture.data.data() + 3 * begin;
    for (std::size_t i = begin; i < end; ++i, rgb += 3)
      out.data[i] = 0.2126f * static_cast<float>(rgb[0]) + 0.7152f * static_cast<float>(rgb[1]) +
                    0.0722f * static_cast<float>(rgb[2]);
  });
  return out;
}

Result<Ssim> Ssim::prepare(ImageLuma reference) {
  const int width = reference.width, height = reference.height;
  if (width < kWindow || height < kWindow)
    return invalid("SSIM needs pictures of at least 11x11, not " + size_of(width, height));
  for (const float v : reference.data)
    if (!(std::abs(v) < kLargestLuma))
      return invalid("the reference picture" + std::string(kNotLuma));

  Ssim out;
  const int stride = rounded_up(width - 2 * kRadius, Lanes<float>::kCount);
  out.mean_ = out.variance_ = ImageLuma(stride, height - 2 * kRadius);
  for_bands(out.mean_.height, [&](int first, int end) {
    Window<double, 2> window(stride);
    for (int y = first; y < end + 2 * kRadius; ++y) {
      for (int x = 0; x < width; ++x) {
        const double v = *reference.at(x, y) - kMiddle;
        window.input(0)[x] = v, window.input(1)[x] = v * v;
      }
      window.push();
      if (y < first + 2 * kRadius) continue;
      for (int x = 0; x < stride; x += 2) {
        const auto mean = window.sum(0, x), variance = window.sum(1, x) - mean * mean;
        for (int i = 0; i < 2; ++i) {
          *out.mean_.at(x + i, y - 2 * kRadius) = static_cast<float>(mean[i] + kMiddle);
          *out.variance_.at(x + i, y - 2 * kRadius) =
              static_cast<float>(std::max(variance[i], 0.0));
        }
      }
    }
  });
  out.reference_ = std::move(reference);
  return out;
}

Result<PictureScore> Ssim::compare(const ImageLuma& test, const ImageMask& mask) const {
  const int width = reference_.width, height = reference_.height;
  if (test.width != width || test.height != height)
    return invalid("SSIM of pictures of different sizes: " + size_of(test.width, test.height) +
                   " against " + size_of(width, height));
  if (!mask.empty() && (mask.width != width || mask.height != height))
    return invalid("SSIM with a mask of another size: " + size_of(mask.width, mask.height) +
                   " for " + size_of(width, height));
  const Difference differs = difference(test, reference_, mask);
  if (!(differs.largest < kLargestLuma))
    return invalid("the tested picture" + std::string(kNotLuma));

  const int windows = width - 2 * kRadius, padded = mean_.width;
  std::vector<Sum> rows(mean_.height);
  for_bands(mean_.height, [&](int first, int end) {
    TestWindow window(padded);
    std::vector<float> inside(padded);
    std::fill_n(inside.begin(), windows, 1.0f);
    MaskWindow touched(mask, windows, padded);
    for (int y = first; y < end + 2 * kRadius; ++y) {
      push_row(window, test.row(y), reference_.row(y), width);
      window.push();
      const int top = y - 2 * kRadius;
      if (top >= first)
        rows[top] = sum_of_row(window, mean_.row(top), variance_.row(top), inside.data(),
                               touched.at(top), padded);
    }
  });

  Sum all;
  for (const Sum& row : rows) {
    all.full += row.full, all.masked += row.masked;
    all.masked_windows += row.masked_windows;
  }
  PictureScore score;
  score.ssim_full = all.full / (static_cast<double>(windows) * mean_.height);
  score.ssim_masked =
      all.masked_windows > 0 ? all.masked / static_cast<double>(all.masked_windows) : 1;
  score.psnr_db = psnr_db(differs);
  return score;
}

}  // namespace mr::eval
