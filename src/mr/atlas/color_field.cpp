#include "mr/atlas/color_field.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mr/kit/srgb.h"

namespace mr::atlas {
namespace {

constexpr double kShoulder = 0.5;  // linear light from which the curve bends
constexpr int kClipped = 254;      // a byte from which on a picture counts as clipped

/// Linear light times a factor; over 1, bent from kShoulder on, with the same slope there, so that
/// 1 stays 1.
double toned(double light, double gain) {
  const double product = light * gain;
  if (gain <= 1 || product <= kShoulder) return product;
  const double along = (product - kShoulder) / (gain - kShoulder);
  const double bend = (gain - 1) / (1 - kShoulder);
  return kShoulder + (1 - kShoulder) * along * (1 + bend) / (1 + bend * along);
}

ToneCurves::Curve curve_of(double gain) {
  ToneCurves::Curve out;
  for (int i = 0; i < 256; ++i) {
    const int shown = kit::to_srgb(toned(kit::to_linear(static_cast<std::uint8_t>(i)), gain));
    out[i] = static_cast<std::uint8_t>(i < kClipped ? std::min(shown, kClipped - 1) : shown);
  }
  return out;
}

}  // namespace

FieldWeights field_weights(Vec2f place) {
  const auto along = [](float at, int count) {
    return std::clamp(at * static_cast<float>(count) - 0.5f, 0.0f, static_cast<float>(count - 1));
  };
  const float x = along(place.x, ColorField::kColumns), y = along(place.y, ColorField::kRows);
  const int x0 = std::min(static_cast<int>(x), ColorField::kColumns - 2);
  const int y0 = std::min(static_cast<int>(y), ColorField::kRows - 2);
  const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
  const auto node = [&](int column, int row) {
    return static_cast<std::uint16_t>((y0 + row) * ColorField::kColumns + x0 + column);
  };
  return {{node(0, 0), node(1, 0), node(0, 1), node(1, 1)},
          {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy}};
}

Vec3f ColorField::at(Vec2f place) const {
  Vec3f out;
  if (empty()) return out;
  const FieldWeights w = field_weights(place);
  for (int i = 0; i < 4; ++i) out += log_gain[w.node[i]] * w.weight[i];
  return out;
}

Vec3f ColorField::mean() const {
  Vec3f sum;
  for (const Vec3f& g : log_gain) sum += g;
  return empty() ? sum : sum / static_cast<float>(log_gain.size());
}

std::size_t ToneCurves::index(float log_gain) {
  constexpr float kMost = kMostStops;
  const float stops = std::clamp(log_gain / std::numbers::ln2_v<float>, -kMost, kMost);
  return static_cast<std::size_t>(std::lround((stops + kMost) * kPerStop));
}

const std::vector<ToneCurves::Curve>& ToneCurves::all() {
  static const std::vector<Curve> curves = [] {
    std::vector<Curve> out;
    for (int i = -kMostStops * kPerStop; i <= kMostStops * kPerStop; ++i)
      out.push_back(curve_of(std::exp2(static_cast<double>(i) / kPerStop)));
    return out;
  }();
  return curves;
}

TileShader::TileShader(const View& tile, const ColorField& field, Vec3f extra) {
  const ToneCurves::Curve* const plain = &ToneCurves::of(0);
  const Rect &at = tile.atlas_rect, &shown = tile.image_rect;
  const auto blocks = [](int size) { return (size + kBlock_px - 1) / kBlock_px; };
  columns_ = blocks(at.width);
  for (int row = 0; row < blocks(at.height); ++row)
    for (int column = 0; column < columns_; ++column) {
      const auto place = [](int block, int size, int first, int count, int whole) {
        const double middle = std::min((block + 0.5) * kBlock_px, size - 0.5) / size;
        return static_cast<float>((first + middle * count) / whole);
      };
      const Vec3f log_gain = field.at({place(column, at.width, shown.x, shown.width, tile.width),
                                       place(row, at.height, shown.y, shown.height, tile.height)}) +
                             extra;
      auto& curves = curves_.emplace_back();
      for (int c = 0; c < 3; ++c) {
        const ToneCurves::Curve& curve = ToneCurves::of(log_gain[c]);
        curves[c] = curve.data();
        is_plain_ = is_plain_ && &curve == plain;
      }
    }
}

void TileShader::apply(int x, int y, int count, std::uint8_t* rgb) const {
  const auto* const row = curves_.data() + static_cast<std::size_t>(y / kBlock_px) * columns_;
  for (const int end = x + count; x < end;) {
    const auto& [red, green, blue] = row[x / kBlock_px];
    for (const int last = std::min(end, (x / kBlock_px + 1) * kBlock_px); x < last; ++x, rgb += 3)
      rgb[0] = red[rgb[0]], rgb[1] = green[rgb[1]], rgb[2] = blue[rgb[2]];
  }
}

}  // namespace mr::atlas
