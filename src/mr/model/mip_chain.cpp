#include "mr/model/mip_chain.h"

#include <algorithm>
#include <cmath>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/kit/srgb.h"

namespace mr::model {
namespace {

/// Bytes for linear colours in small steps, for whole pictures.
constexpr int kSteps = 1 << 14;
const std::vector<std::uint8_t>& byte_table() {
  static const std::vector<std::uint8_t> table = [] {
    std::vector<std::uint8_t> out(kSteps + 1);
    for (int i = 0; i <= kSteps; ++i) out[i] = kit::to_srgb(static_cast<double>(i) / kSteps);
    return out;
  }();
  return table;
}

/// Each pixel is the mean light of four; the last of an odd number of rows or columns is left out.
ImageRgb halved(const ImageRgb& in) {
  ImageRgb out(std::max(in.width / 2, 1), std::max(in.height / 2, 1));
  const std::vector<std::uint8_t>& bytes = byte_table();
  parallel_for(out.height, 64, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < out.width; ++x) {
        const int right = std::min(2 * x + 1, in.width - 1);
        const int down = std::min(2 * y + 1, in.height - 1);
        for (int i = 0; i < 3; ++i) {
          const float sum =
              kit::to_linear(in.at(2 * x, 2 * y)[i]) + kit::to_linear(in.at(right, 2 * y)[i]) +
              kit::to_linear(in.at(2 * x, down)[i]) + kit::to_linear(in.at(right, down)[i]);
          out.at(x, y)[i] = bytes[static_cast<std::size_t>(sum * (kSteps / 4.0f) + 0.5f)];
        }
      }
  });
  return out;
}

/// A pixel column or row within [0, count).
int wrapped(int i, int count, Wrap wrap) {
  if (wrap == Wrap::clamp) return std::clamp(i, 0, count - 1);
  const int period = wrap == Wrap::mirror ? 2 * count : count;
  const int at = ((i % period) + period) % period;
  return at < count ? at : period - 1 - at;
}

/// A coordinate without the whole periods that change nothing, so that it fits an int in pixels.
double reduced(double u, Wrap wrap) {
  if (wrap == Wrap::clamp) return std::clamp(u, 0.0, 1.0);
  const double period = wrap == Wrap::mirror ? 2 : 1;
  return u - period * std::floor(u / period);
}

Vec3f bilinear(const ImageRgb& picture, Vec2f uv, const std::array<Wrap, 2>& wrap) {
  const double x = reduced(uv.x, wrap[0]) * picture.width - 0.5;
  const double y = reduced(uv.y, wrap[1]) * picture.height - 0.5;
  const int left = static_cast<int>(std::floor(x)), top = static_cast<int>(std::floor(y));
  const auto fx = static_cast<float>(x - left), fy = static_cast<float>(y - top);
  Vec3f out;
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) {
      const float weight = (i == 0 ? 1 - fx : fx) * (j == 0 ? 1 - fy : fy);
      const std::uint8_t* p = picture.at(wrapped(left + i, picture.width, wrap[0]),
                                         wrapped(top + j, picture.height, wrap[1]));
      out += Vec3f{kit::to_linear(p[0]), kit::to_linear(p[1]), kit::to_linear(p[2])} * weight;
    }
  return out;
}

}  // namespace

MipChain::MipChain(ImageRgb picture) {
  MR_ASSERT(!picture.empty());
  levels_.push_back(std::move(picture));
  while (levels_.back().width > 1 || levels_.back().height > 1)
    levels_.push_back(halved(levels_.back()));
}

Vec3f MipChain::sample(Vec2f uv, const std::array<Wrap, 2>& wrap, float extent_texels) const {
  const double wanted = std::log2(std::clamp(double{extent_texels}, 1.0, 65536.0));
  const auto level = std::min(static_cast<std::size_t>(std::lround(wanted)), levels_.size() - 1);
  return bilinear(levels_[level], uv, wrap);
}

}  // namespace mr::model
