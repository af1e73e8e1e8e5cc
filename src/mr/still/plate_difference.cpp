#include "mr/still/plate_difference.h"

#include <algorithm>
#include <cmath>

#include "mr/core/assert.h"

namespace mr::still {
namespace {

constexpr int kSameLevels = 10, kDifferentLevels = 26;  // of 255, in the channel that differs most
constexpr int kStaysLevels = 17;  // what was different in the capture before stays so above
constexpr int kDarkLevels = 48;
constexpr float kDarkestShadow = 0.6f;  // of the light

int blocks(int px) { return (px + PlateDifference::kBlock_px - 1) / PlateDifference::kBlock_px; }

/// How much a colour differs from a room's, which may lie in shadow.
float difference(const std::array<int, 3>& now, const std::array<float, 3>& room) {
  float both = 0, square = 0;
  for (int c = 0; c < 3; ++c) both += now[c] * room[c], square += room[c] * room[c];
  const float light = square > 0 ? std::clamp(both / square, kDarkestShadow, 1.0f) : 1;
  float most = 0;
  for (int c = 0; c < 3; ++c) most = std::max(most, std::abs(now[c] - light * room[c]));
  return most;
}

}  // namespace

PlateDifference::PlateDifference(const Input& in, const ImageMask& was_different)
    : in_(in),
      was_different_(was_different),
      colors_((in.color.width + kStep_px - 1) / kStep_px,
              (in.color.height + kStep_px - 1) / kStep_px, PlateColor::unknown),
      is_compared_(blocks(colors_.width), blocks(colors_.height)),
      different_(colors_.width, colors_.height) {
  MR_ASSERT(was_different.empty() ||
            (was_different.width == colors_.width && was_different.height == colors_.height));
}

PlateColor PlateDifference::at(int x, int y) {
  const int column = x / kBlock_px, row = y / kBlock_px;
  if (std::uint8_t& is_compared = *is_compared_.at(column, row); !is_compared) {
    is_compared = 1;
    if (in_.known.at(column, row)) compare(column, row);
  }
  return *colors_.at(x, y);
}

void PlateDifference::compare(int column, int row) {
  const int x_end = std::min((column + 1) * kBlock_px, colors_.width),
            y_end = std::min((row + 1) * kBlock_px, colors_.height);
  for (int y = row * kBlock_px; y < y_end; ++y)
    for (int x = column * kBlock_px; x < x_end; ++x) {
      const bool was_different = !was_different_.empty() && *was_different_.at(x, y);
      const PlateColor color = *colors_.at(x, y) = compare(x, y, was_different);
      *different_.at(x, y) = color == PlateColor::different;
    }
}

PlateColor PlateDifference::compare(int x, int y, bool was_different) const {
  const auto now = mean_of(in_.color, x, y), plate = mean_of(in_.plate, x, y);
  const float d =
      difference(now, {plate[0] * in_.gain.x, plate[1] * in_.gain.y, plate[2] * in_.gain.z});
  if (d >= (was_different ? kStaysLevels : kDifferentLevels)) return PlateColor::different;
  if (std::max({now[0], now[1], now[2]}) < kDarkLevels) return PlateColor::dark;
  return d < kSameLevels ? PlateColor::same : PlateColor::unsure;
}

/// The mean of a pixel of the plane, as far as the picture reaches.
std::array<int, 3> PlateDifference::mean_of(const ImageRgb& picture, int x, int y) const {
  const int x0 = x * kStep_px, y0 = y * kStep_px;
  const int x1 = std::min(x0 + kStep_px, picture.width),
            y1 = std::min(y0 + kStep_px, picture.height);
  std::array<int, 3> sum{};
  for (int v = y0; v < y1; ++v) {
    const std::uint8_t* const row = picture.row(v);
    for (int u = 3 * x0; u < 3 * x1; u += 3)
      for (int c = 0; c < 3; ++c) sum[c] += row[u + c];
  }
  const int count = (x1 - x0) * (y1 - y0);
  for (int& s : sum) s /= count;
  return sum;
}

}  // namespace mr::still
