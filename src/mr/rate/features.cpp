#include "mr/rate/features.h"

#include <algorithm>
#include <cmath>

#include "mr/core/parallel.h"
#include "mr/core/simd.h"

namespace mr::rate {
namespace {

constexpr int kN = kFeatureBlock;
constexpr int kRowGrain = 32;   // rows of pixels for a thread
constexpr int kStripGrain = 2;  // rows of blocks for a thread
/// A change of depth by more standard deviations is motion: three of a sensor whose noise is four
/// times what its precision says.
constexpr double kMovedSigmas = 12;

struct MeanAndDeviation {
  double mean = 0, deviation = 0;
};

/// Of value(block) over blocks; not empty.
template <typename Value>
MeanAndDeviation over_blocks(const std::vector<BlockFeatures>& blocks, Value value) {
  double sum = 0, squares = 0;
  for (const BlockFeatures& block : blocks) sum += value(block);
  const double mean = sum / static_cast<double>(blocks.size());
  for (const BlockFeatures& block : blocks) {
    const double off = value(block) - mean;
    squares += off * off;
  }
  return {mean, std::sqrt(squares / static_cast<double>(blocks.size()))};
}

/// Standard deviation of all pixels: the variances inside the blocks, and that of their means.
double pixel_deviation(const std::vector<BlockFeatures>& blocks) {
  constexpr double kPixels = kN * kN;
  const auto means =
      over_blocks(blocks, [](const BlockFeatures& b) { return b.first + b.sum / kPixels; });
  const auto inside = over_blocks(blocks, [](const BlockFeatures& b) {
    const double mean = b.sum / kPixels;
    return std::max(0.0, b.sum_of_squares / kPixels - mean * mean);
  });
  return std::sqrt(inside.mean + means.deviation * means.deviation);
}

/// For each row of a picture the depth that its pixels before the first valid one take, in metres.
std::vector<float> row_beginnings(const ImageDepth& depth) {
  std::vector<float> before_m(depth.height);
  const auto first = std::find_if(depth.data.begin(), depth.data.end(), is_measured);
  float last_m = first == depth.data.end() ? 0 : *first;
  for (int y = 0; y < depth.height; ++y) {
    if (depth.width > 0 && is_measured(*depth.row(y))) last_m = *depth.row(y);
    before_m[y] = last_m;
  }
  return before_m;
}

}  // namespace

double dct_energy(const Image<float, 1>& plane) {
  apply_simd_override();
  const std::size_t columns = plane.width / kN, rows = plane.height / kN;
  if (columns * rows == 0) return 0;
  std::vector<BlockFeatures> blocks(columns * rows);
  parallel_for(rows, kStripGrain, [&](std::size_t begin, std::size_t end) {
    DctBlock unused;
    for (std::size_t b = begin * columns; b < end * columns; ++b)
      blocks[b] = block_features(
          plane.at(static_cast<int>(b % columns) * kN, static_cast<int>(b / columns) * kN),
          plane.width, unused);
  });
  return over_blocks(blocks, [](const BlockFeatures& b) { return b.spatial; }).mean;
}

Image<float, 1> luma_plane(const ImageRgb& picture) {
  apply_simd_override();
  auto plane = Image<float, 1>::unfilled(picture.width, picture.height);
  parallel_for(picture.height, kRowGrain, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      luma_row(picture.row(y), picture.width, plane.row(y));
  });
  return plane;
}

Image<float, 1> depth_plane(const ImageDepth& depth) {
  apply_simd_override();
  auto plane = Image<float, 1>::unfilled(depth.width, depth.height);
  const std::vector<float> before_m = row_beginnings(depth);
  parallel_for(depth.height, kRowGrain, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      depth_row(depth.row(y), depth.width, before_m[y], plane.row(y));
  });
  return plane;
}

/// `row(y, out)` writes the `width` values of a row of the picture to `out`.
template <typename Row>
PictureFeatures FeatureExtractor::extract_picture(int width, int height, const Row& row,
                                                  History& history) {
  const std::size_t columns = width / kN, rows = height / kN;
  if (history.width != width || history.height != height)
    history = {width, height, false, std::vector<DctBlock>(columns * rows), {}};
  if (columns * rows == 0) return {};
  std::vector<BlockFeatures> blocks(columns * rows);
  parallel_for(rows, kStripGrain, [&](std::size_t begin, std::size_t end) {
    auto strip = Image<float, 1>::unfilled(width, kN);
    for (std::size_t j = begin; j < end; ++j) {
      for (int y = 0; y < kN; ++y) row(static_cast<int>(j) * kN + y, strip.row(y));
      for (std::size_t i = 0; i < columns; ++i)
        blocks[j * columns + i] = block_features(strip.at(static_cast<int>(i) * kN, 0), width,
                                                 history.dct[j * columns + i]);
    }
  });

  PictureFeatures features;
  const auto spatial = over_blocks(blocks, [](const BlockFeatures& b) { return b.spatial; });
  features.spatial = spatial.mean, features.spatial_deviation = spatial.deviation;
  features.pixel_deviation = pixel_deviation(blocks);
  if (history.has_picture) {
    const auto temporal = over_blocks(blocks, [](const BlockFeatures& b) { return b.temporal; });
    features.temporal = temporal.mean, features.temporal_deviation = temporal.deviation;
    features.temporal_gradient = temporal.mean - history.temporal.value_or(temporal.mean);
    history.temporal = temporal.mean;
  }
  history.has_picture = true;
  return features;
}

double FeatureExtractor::moving_pixels(const ImageDepth& depth) {
  if (depth_before_.width != depth.width || depth_before_.height != depth.height)
    depth_before_ = ImageDepth(depth.width, depth.height);  // nothing is valid
  std::vector<DepthChange> rows(depth.height);
  parallel_for(depth.height, kRowGrain, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      rows[y] = replace_depth_row(depth.row(y), depth.width, precision_, kMovedSigmas,
                                  depth_before_.row(y));
  });
  DepthChange all;
  for (const DepthChange& row : rows) all.measured += row.measured, all.moved += row.moved;
  return all.measured == 0 ? 0 : static_cast<double>(all.moved) / static_cast<double>(all.measured);
}

SceneFeatures FeatureExtractor::extract(const Frame& frame) {
  apply_simd_override();
  const ImageRgb& color = frame.color;
  const ImageDepth& depth = frame.depth;
  const std::vector<float> before_m = row_beginnings(depth);
  SceneFeatures features;
  features.color = extract_picture(
      color.width, color.height,
      [&](int y, float* luma) { luma_row(color.row(y), color.width, luma); }, color_);
  features.depth = extract_picture(
      depth.width, depth.height,
      [&](int y, float* mm) { depth_row(depth.row(y), depth.width, before_m[y], mm); }, depth_);
  features.moving_pixels = moving_pixels(depth);
  return features;
}

namespace {

/// Calls `at` with every feature, in the order in which they are stored.
template <typename Features, typename At>
void for_each_feature(Features& features, const At& at) {
  for (auto* picture : {&features.color, &features.depth}) {
    at(picture->spatial), at(picture->temporal);
    at(picture->spatial_deviation), at(picture->temporal_deviation);
    at(picture->temporal_gradient), at(picture->pixel_deviation);
  }
  at(features.moving_pixels), at(features.mask_coverage), at(features.triangles);
}

}  // namespace

std::vector<float> values_of(const SceneFeatures& features) {
  std::vector<float> out;
  for_each_feature(features, [&](double value) { out.push_back(static_cast<float>(value)); });
  return out;
}

std::optional<SceneFeatures> features_of(std::span<const float> values) {
  SceneFeatures out;
  std::size_t at = 0;
  for_each_feature(out, [&](double& value) { value = at < values.size() ? values[at] : 0, ++at; });
  return at == values.size() ? std::optional(out) : std::nullopt;
}

SceneFeatures mean_features(std::span<const SensorFeatures> sensors) {
  constexpr double PictureFeatures::*kValues[] = {
      &PictureFeatures::spatial,           &PictureFeatures::temporal,
      &PictureFeatures::spatial_deviation, &PictureFeatures::temporal_deviation,
      &PictureFeatures::temporal_gradient, &PictureFeatures::pixel_deviation};
  constexpr double SceneFeatures::*kOwnValues[] = {
      &SceneFeatures::moving_pixels, &SceneFeatures::mask_coverage, &SceneFeatures::triangles};
  SceneFeatures mean;
  double colored = 0;
  for (const auto& [has_color, features] : sensors) {
    for (const auto value : kValues) {
      mean.depth.*value += features.depth.*value;
      if (has_color) mean.color.*value += features.color.*value;
    }
    for (const auto value : kOwnValues) mean.*value += features.*value;
    colored += has_color;
  }
  const double all = std::max(static_cast<double>(sensors.size()), 1.0);
  for (const auto value : kValues)
    mean.depth.*value /= all, mean.color.*value /= std::max(colored, 1.0);
  for (const auto value : kOwnValues) mean.*value /= all;
  return mean;
}

}  // namespace mr::rate
