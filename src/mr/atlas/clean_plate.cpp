#include "mr/atlas/clean_plate.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <utility>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"

namespace mr::atlas {
namespace {

constexpr int kFirstCaptures = 4, kRefinedCaptures = 32;  // powers of two: see copy()
constexpr int kDoubtsToCheck = 3;  // consecutive captures, while the plate is not refined
constexpr int kCellLevel = 16;     // of 255, in units of a cell
constexpr int kWhite = 255 * kCellLevel;
constexpr int kMostNoise = 4096;  // a running screen is not noise
constexpr int kGainOne = 8192;    // gains are in 8192ths
constexpr int kLeastPlateGain = kGainOne / 4, kMostPlateGain = 4 * kGainOne;
constexpr int kGainDeadBand = 160;  // a 160th: half a step of bright sRGB
constexpr std::size_t kFewVotes = 12;
constexpr int kUsualLasts = 256;  // captures; longer than a key-frame interval
constexpr int kHabitFades = 8;    // captures for a sixteenth of a level
constexpr int kEnoughAround = 5;  // of nine blocks
constexpr int kDarkestVote = 16, kBrightestVote = 240;  // level of a block's mean
constexpr int kClipped = 250;                           // level of a pixel
constexpr int kFillDeadBand = 6;                        // levels
constexpr std::uint8_t kGrey = 128;
constexpr std::size_t kRowsAtOnce = 4;

/// Reduces the 4x4 pixels of each cell to one value per channel.
template <typename Cells, typename Fold>
Cells fold_cells(const std::uint8_t* pixels, std::size_t stride, const Fold& fold) {
  Cells out;
  std::array<std::uint16_t, 48> line, two;
  for (int row = 0; row < 4; ++row) {
    const std::uint8_t* const p = pixels + 4 * row * stride;
    for (std::size_t i = 0; i < 48; ++i)
      line[i] = fold(fold(p[i], p[i + stride]), fold(p[i + 2 * stride], p[i + 3 * stride]));
    for (int i = 0; i < 45; ++i) two[i] = fold(line[i], line[i + 3]);
    for (int cell = 0; cell < 4; ++cell)
      for (int c = 0; c < 3; ++c)
        out[12 * row + 3 * cell + c] = fold(two[12 * cell + c], two[12 * cell + 6 + c]);
  }
  return out;
}

template <typename Cells>
Cells sums_of_cells(const std::uint8_t* pixels, std::size_t stride) {
  return fold_cells<Cells>(pixels, stride, [](std::uint16_t a, std::uint16_t b) {
    return static_cast<std::uint16_t>(a + b);
  });
}

template <typename Cells>
Cells brightest_of_cells(const std::uint8_t* pixels, std::size_t stride) {
  Cells out = fold_cells<Cells>(pixels, stride,
                                [](std::uint16_t a, std::uint16_t b) { return std::max(a, b); });
  for (std::uint16_t& v : out) v = static_cast<std::uint16_t>(v * kCellLevel);
  return out;
}

/// A cell's value times a gain.
std::uint16_t times(std::uint16_t value, std::uint16_t gain) {
  return static_cast<std::uint16_t>((static_cast<std::uint32_t>(value << 3) * gain) >> 16);
}

/// Sum over the cells, by channel.
template <typename Cells>
std::array<std::uint32_t, 3> sum_of(const Cells& cells) {
  std::array<std::uint32_t, 3> sum{};
  for (std::size_t i = 0; i < cells.size(); i += 3)
    for (int c = 0; c < 3; ++c) sum[c] += cells[i + c];
  return sum;
}

/// One level of a push-pull pyramid (Gortler et al. 1996) over the blocks: averages of known
/// colours go up, and unknown ones are interpolated from the coarser level.
struct ColorGrid {
  int columns = 0, rows = 0;
  std::vector<std::array<float, 4>> cells;  ///< red, green, blue, weight

  ColorGrid(int c, int r) : columns(c), rows(r), cells(static_cast<std::size_t>(c) * r) {}
  std::array<float, 4>& at(int x, int y) {
    x = std::clamp(x, 0, columns - 1), y = std::clamp(y, 0, rows - 1);
    return cells[static_cast<std::size_t>(y) * columns + x];
  }

  ColorGrid halved() {
    ColorGrid out((columns + 1) / 2, (rows + 1) / 2);
    for (int y = 0; y < rows; ++y)
      for (int x = 0; x < columns; ++x) {
        const auto& [r, g, b, weight] = at(x, y);
        auto& sum = out.at(x / 2, y / 2);
        sum[0] += r * weight, sum[1] += g * weight, sum[2] += b * weight, sum[3] += weight;
      }
    for (auto& cell : out.cells) {
      if (cell[3] == 0) continue;
      for (int c = 0; c < 3; ++c) cell[c] /= cell[3];
      cell[3] = std::min(cell[3], 1.0f);
    }
    return out;
  }

  /// Pull: interpolates cells without a colour bilinearly from the coarser level.
  void complete(ColorGrid& coarse) {
    for (int y = 0; y < rows; ++y)
      for (int x = 0; x < columns; ++x) {
        auto& cell = at(x, y);
        if (cell[3] > 0) continue;
        const int x0 = x / 2, y0 = y / 2, x1 = x0 + (x % 2 ? 1 : -1), y1 = y0 + (y % 2 ? 1 : -1);
        for (int c = 0; c < 3; ++c)
          cell[c] = (9 * coarse.at(x0, y0)[c] + 3 * coarse.at(x1, y0)[c] +
                     3 * coarse.at(x0, y1)[c] + coarse.at(x1, y1)[c]) /
                    16;
      }
  }
};

void complete(ColorGrid& grid) {
  if (grid.columns == 1 && grid.rows == 1) return;
  ColorGrid coarse = grid.halved();
  complete(coarse);
  grid.complete(coarse);
}

}  // namespace

Vec3f CleanPlate::gain() const {
  return {static_cast<float>(gain_[0]) / kGainOne, static_cast<float>(gain_[1]) / kGainOne,
          static_cast<float>(gain_[2]) / kGainOne};
}

void CleanPlate::start(int width, int height) {
  picture_ = ImageRgb(width, height, kGrey);
  valid_.tile_px = kBlock_px;
  valid_.columns = (width + kBlock_px - 1) / kBlock_px;
  valid_.rows = (height + kBlock_px - 1) / kBlock_px;
  const std::size_t count = static_cast<std::size_t>(valid_.columns) * valid_.rows;
  valid_.tiles.assign(count, 0);
  gain_ = {kGainOne, kGainOne, kGainOne};
  usual_cell_off_ = usual_block_off_ = 0;
  blocks_.assign(count, {});
  sums_.assign(count, {});
  fill_colors_.assign(count, {kGrey, kGrey, kGrey});
}

bool CleanPlate::update(const ImageRgb& live, const TileMask& unhidden) {
  MR_ASSERT(!live.empty());
  const bool is_new = live.width != picture_.width || live.height != picture_.height;
  if (is_new) start(live.width, live.height);
  ++captures_;
  measure(live, unhidden);
  const bool exposure_moved = follow_exposure();
  compare();

  const std::vector<std::uint8_t> valid_before = valid_.tiles;
  std::vector<std::size_t> copied(valid_.rows, 0);
  parallel_for(valid_.rows, kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row)
      for (int column = 0; column < valid_.columns; ++column)
        copied[row] += take(row * valid_.columns + column, live);
  });
  changed_blocks_ = std::accumulate(copied.begin(), copied.end(), std::size_t{0});
  if (valid_.tiles != valid_before) fill_invalid();
  return is_new || exposure_moved || changed_blocks_ > 0;
}

/// The pixels of a block; beyond the picture the last row and column are repeated.
CleanPlate::Pixels CleanPlate::pixels_of(const ImageRgb& image, std::size_t block) const {
  const int x0 = static_cast<int>(block % valid_.columns) * kBlock_px;
  const int y0 = static_cast<int>(block / valid_.columns) * kBlock_px;
  const int columns = std::min(kBlock_px, image.width - x0);
  Pixels out;
  for (int y = 0; y < kBlock_px; ++y) {
    std::uint8_t* const row = out.data() + y * kBlock_px * 3;
    std::copy_n(image.at(x0, std::min(y0 + y, image.height - 1)), 3 * columns, row);
    for (int x = columns; x < kBlock_px; ++x) std::copy_n(row + 3 * (columns - 1), 3, row + 3 * x);
  }
  return out;
}

/// Computes the cells of unhidden blocks and updates their noise estimates.
void CleanPlate::measure(const ImageRgb& live, const TileMask& unhidden) {
  const bool has_mask = unhidden.tile_px == kBlock_px && unhidden.columns == valid_.columns &&
                        unhidden.rows == valid_.rows && unhidden.tiles.size() == blocks_.size();
  const auto measure_block = [&](std::size_t i) {
    Block& block = blocks_[i];
    const bool was_seen = std::exchange(block.seen, has_mask && unhidden.tiles[i] != 0);
    if (!block.seen) return;
    const int x = static_cast<int>(i % valid_.columns) * kBlock_px;
    const int y = static_cast<int>(i / valid_.columns) * kBlock_px;
    const bool whole = x + kBlock_px <= live.width && y + kBlock_px <= live.height;
    const Cells now = whole ? sums_of_cells<Cells>(live.at(x, y), std::size_t{3} * live.width)
                            : sums_of_cells<Cells>(pixels_of(live, i).data(), 3 * kBlock_px);
    if (was_seen) {
      int change = 0;
      for (int k = 0; k < kCellValues; ++k) change += std::abs(int{now[k]} - int{block.now[k]});
      change = std::min(change, kMostNoise);
      block.noise = static_cast<std::uint16_t>(
          block.noise == 0 ? change : block.noise + (change - int{block.noise}) / 8);
    }
    block.now = now;
  };
  parallel_for(valid_.rows, kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin * valid_.columns; i < end * valid_.columns; ++i) measure_block(i);
  });
}

/// Each block's estimate of the gain. Clipped and dark blocks give none.
std::array<std::vector<std::uint16_t>, 3> CleanPlate::exposure_votes() const {
  constexpr std::uint32_t kBlockLevel = 16 * kCellLevel;  // in units of a sum over the cells
  std::array<std::vector<std::uint16_t>, 3> votes;
  for (auto& v : votes) v.reserve(blocks_.size());
  for (const Block& block : blocks_) {
    if (!block.seen || block.stage == Stage::collecting) continue;
    const std::array<std::uint32_t, 3> live = sum_of(block.now);
    for (int c = 0; c < 3; ++c) {
      const std::uint32_t plate = block.sum[c];
      if (live[c] < kDarkestVote * kBlockLevel || live[c] > kBrightestVote * kBlockLevel ||
          plate < kDarkestVote * kBlockLevel ||
          block.most[c] * std::max<int>(gain_[c], kGainOne) > kClipped * kGainOne)
        continue;
      votes[c].push_back(static_cast<std::uint16_t>(
          std::clamp<std::uint32_t>(live[c] * kGainOne / plate, kLeastPlateGain, kMostPlateGain)));
    }
  }
  return votes;
}

/// Sets the gain to the median of the blocks' estimates if it lies outside a dead band.
bool CleanPlate::follow_exposure() {
  bool moved = false;
  auto all_votes = exposure_votes();
  for (int c = 0; c < 3; ++c) {
    std::vector<std::uint16_t>& votes = all_votes[c];
    if (votes.size() < kFewVotes) continue;
    const auto middle = votes.begin() + static_cast<std::ptrdiff_t>(votes.size() / 2);
    std::nth_element(votes.begin(), middle, votes.end());
    if (std::abs(int{*middle} - int{gain_[c]}) * kGainDeadBand <= gain_[c]) continue;
    gain_[c] = *middle;
    moved = true;
  }
  return moved;
}

/// Computes each block's difference from the plate, and a robust average over blocks.
void CleanPlate::compare() {
  parallel_for(blocks_.size(), 128, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Block& block = blocks_[i];
      block.compared = block.seen && block.stage != Stage::collecting;
      if (block.compared) compare(block);
    }
  });
  std::vector<int> cells, means;
  cells.reserve(blocks_.size()), means.reserve(blocks_.size());
  for (const Block& block : blocks_)
    if (block.compared) cells.push_back(block.cell_off), means.push_back(block.block_off);
  if (cells.size() < kFewVotes) return;
  const auto follow = [](int& usual, std::vector<int>& values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    usual = std::max(*middle, usual - (usual + kUsualLasts - 1) / kUsualLasts);
  };
  follow(usual_cell_off_, cells);
  follow(usual_block_off_, means);
}

/// Compares a block's cells with the plate. If the gain clips some pixels of a cell at white, the
/// cell's expected mean is an interval.
void CleanPlate::compare(Block& block) const {
  std::array<std::uint16_t, kCellValues> gain;
  for (int k = 0; k < kCellValues; ++k) gain[k] = gain_[k % 3];
  std::array<int, kCellValues> off;
  for (int k = 0; k < kCellValues; ++k) {
    const int shown = times(block.plate[k], gain[k]);
    const int beyond = std::max(0, times(block.brightest[k], gain[k]) - kWhite);
    const int above = std::max(0, int{block.now[k]} - std::min(shown, kWhite));
    const int below = std::max(0, shown - beyond - int{block.now[k]});
    off[k] = above - below;
  }
  block.cell_off = 0;
  for (const int v : off) block.cell_off = std::max(block.cell_off, std::abs(v));
  block.shift = {0, 0, 0};
  for (int k = 0; k < kCellValues; k += 3)
    for (int c = 0; c < 3; ++c) block.shift[c] += off[k + c];
  block.block_off = 0;
  for (int& shift : block.shift) {
    shift /= kCellValues / 3;
    block.block_off = std::max(block.block_off, std::abs(shift));
  }
}

CleanPlate::Limits CleanPlate::limits_of(const Block& block) const {
  // Four times the spread of a cell's mean, of which the sum of the cells' changes is 868.
  const int noise = std::clamp(block.noise * 19 / 256, 3 * kCellLevel, 10 * kCellLevel);
  // Coding noise is up to three times the usual in single blocks, and is uncorrelated between
  // neighbours.
  Limits out{std::max(noise, std::min(3 * usual_cell_off_, 24 * kCellLevel)),
             std::clamp(7 * usual_block_off_ / 2, 5 * kCellLevel / 2, 8 * kCellLevel),
             std::clamp(3 * usual_block_off_ / 2, 3 * kCellLevel / 2, 4 * kCellLevel)};
  // Hysteresis: a block whose difference stays near the limit is not replaced every time.
  out.cell = std::max(out.cell, std::min(block.cell_habit, 10 * kCellLevel));
  out.block = std::max(out.block, std::min(block.block_habit, 4 * kCellLevel));
  // The gain is applied to sRGB, but exposure acts on linear light: at gain 2 the error is up to
  // ten levels.
  int most = 0;
  for (const std::uint16_t g : gain_) most = std::max(most, std::abs(int{g} - kGainOne));
  for (int* const limit : {&out.cell, &out.block, &out.around}) {
    if (!block.refined) *limit += *limit / 4;
    *limit += most * 10 * kCellLevel / kGainOne;
  }
  return out;
}

/// Whether a block differs by more than a multiple of its limits.
bool CleanPlate::is_off(std::size_t i, int factor) const {
  const Block& block = blocks_[i];
  const Limits limits = limits_of(block);
  return block.cell_off > factor * limits.cell || block.block_off > factor * limits.block ||
         (block.block_off > factor * limits.around && is_off_around(i, factor * limits.around));
}

/// Whether a block and most of its neighbours have become brighter, or darker, as by a change of
/// illumination.
bool CleanPlate::is_off_around(std::size_t i, int limit) const {
  const int column = static_cast<int>(i % valid_.columns);
  const int row = static_cast<int>(i / valid_.columns);
  for (int c = 0; c < 3; ++c) {
    const int own = blocks_[i].shift[c];
    if (std::abs(own) <= limit) continue;
    int there = 0, alike = 0;
    for (int y = std::max(0, row - 1); y <= std::min(valid_.rows - 1, row + 1); ++y)
      for (int x = std::max(0, column - 1); x <= std::min(valid_.columns - 1, column + 1); ++x) {
        const Block& other = blocks_[static_cast<std::size_t>(y) * valid_.columns + x];
        if (!other.compared) continue;
        ++there;
        alike += (own > 0 ? other.shift[c] : -other.shift[c]) > limit;
      }
    if (there >= kEnoughAround && 2 * alike > there) return true;
  }
  return false;
}

/// Starts a new sum with the next capture.
void CleanPlate::start_sums(std::size_t i) {
  blocks_[i].captures = 0;
  sums_[i].fill(0);
}

/// Starts a new sum with the newest capture.
void CleanPlate::start_check(std::size_t i) {
  blocks_[i].stage = Stage::checking;
  start_sums(i);
}

void CleanPlate::accumulate(std::size_t i, const ImageRgb& live) {
  std::array<std::uint16_t, 3 * kBlock_px> inverse;  // of the gain, in 2048ths
  for (int k = 0; k < 3 * kBlock_px; ++k)
    inverse[k] = static_cast<std::uint16_t>((2048 * kGainOne + gain_[k % 3] / 2) / gain_[k % 3]);
  const Pixels pixels = pixels_of(live, i);
  for (int y = 0; y < kBlock_px; ++y) {
    std::uint16_t* const sum = sums_[i].data() + 3 * kBlock_px * y;
    const std::uint8_t* const pixel = pixels.data() + 3 * kBlock_px * y;
    for (int k = 0; k < 3 * kBlock_px; ++k) {
      const auto value = static_cast<std::uint16_t>(pixel[k] << 8);
      const auto eighths = static_cast<std::uint16_t>((std::uint32_t{value} * inverse[k]) >> 16);
      sum[k] = static_cast<std::uint16_t>(sum[k] + std::min<std::uint16_t>(eighths, 8 * 255));
    }
  }
  ++blocks_[i].captures;
}

/// Copies the mean of the summed captures into the picture.
void CleanPlate::copy(std::size_t i) {
  Block& block = blocks_[i];
  const int bits = block.captures == kFirstCaptures ? 5 : 8;  // log2(captures · 8)
  Pixels pixels;
  for (int k = 0; k < kBlockValues; ++k)
    pixels[k] = static_cast<std::uint8_t>((sums_[i][k] + (1 << bits >> 1)) >> bits);
  block.plate = sums_of_cells<Cells>(pixels.data(), 3 * kBlock_px);
  block.brightest = brightest_of_cells<Cells>(pixels.data(), 3 * kBlock_px);
  block.sum = sum_of(block.plate);
  block.most = {0, 0, 0};
  for (int k = 0; k < kBlockValues; ++k) block.most[k % 3] = std::max(block.most[k % 3], pixels[k]);
  const int x0 = static_cast<int>(i % valid_.columns) * kBlock_px;
  const int y0 = static_cast<int>(i / valid_.columns) * kBlock_px;
  const int columns = std::min(kBlock_px, picture_.width - x0);
  for (int y = 0; y < std::min(kBlock_px, picture_.height - y0); ++y)
    std::copy_n(pixels.data() + 3 * kBlock_px * y, 3 * columns, picture_.at(x0, y0 + y));
  valid_.tiles[i] = 1;
}

/// Advances a block's state with the newest capture; returns whether the block was replaced.
bool CleanPlate::take(std::size_t i, const ImageRgb& live) {
  Block& block = blocks_[i];
  if (!block.seen) {  // a block that was hidden starts again
    if (block.stage == Stage::checking)
      block.stage = block.refined ? Stage::settled : Stage::refining;
    if (block.captures > 0) start_sums(i);
    block.doubts = 0;
    return false;
  }
  if (captures_ % kHabitFades == 0) {
    block.cell_habit = std::max(0, block.cell_habit - 1);
    block.block_habit = std::max(0, block.block_habit - 1);
  }
  if (block.compared) {
    block.doubts = static_cast<std::uint8_t>(is_off(i, 1) ? std::min(block.doubts + 1, 255) : 0);
    const bool is_sure = block.stage == Stage::settled || (block.doubts > 0 && is_off(i, 2));
    if (block.stage != Stage::checking && block.doubts >= (is_sure ? 1 : kDoubtsToCheck))
      start_check(i);
  }
  if (block.stage == Stage::settled) return false;
  accumulate(i, live);
  return next_stage(i);
}

/// Advances a block's stage once enough captures are summed.
bool CleanPlate::next_stage(std::size_t i) {
  Block& block = blocks_[i];
  if (block.stage == Stage::checking && block.doubts == 0) {  // the change did not last
    block.stage = block.refined ? Stage::settled : Stage::refining;
    if (!block.refined) start_sums(i);
    return false;
  }
  const int enough = block.stage == Stage::refining ? kRefinedCaptures : kFirstCaptures;
  if (block.captures != enough) return false;
  if (block.stage == Stage::checking) {
    block.cell_habit = 5 * block.cell_off / 4;
    block.block_habit = 5 * block.block_off / 4;
  }
  copy(i);
  block.refined = block.stage == Stage::refining;
  block.stage = block.refined ? Stage::settled : Stage::refining;
  block.doubts = 0;
  return true;
}

/// Fills invalid blocks by interpolating between colours at the centres of all blocks (push-pull).
/// Colours that hardly change are kept, so that the video does not change.
void CleanPlate::fill_invalid() {
  ColorGrid grid(valid_.columns, valid_.rows);
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    if (!valid_.tiles[i]) continue;
    for (int c = 0; c < 3; ++c)
      grid.cells[i][c] = static_cast<float>(blocks_[i].sum[c]) / (16 * kCellLevel);
    grid.cells[i][3] = 1;
  }
  complete(grid);
  std::vector<std::uint8_t> moved(blocks_.size(), 0);
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    Color color;
    for (int c = 0; c < 3; ++c) {
      color[c] = static_cast<std::uint8_t>(std::lround(grid.cells[i][c]));
      moved[i] |= std::abs(int{color[c]} - int{fill_colors_[i][c]}) > kFillDeadBand;
    }
    if (moved[i]) fill_colors_[i] = color;
  }
  parallel_for(valid_.rows, kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
    for (int row = static_cast<int>(begin); row < static_cast<int>(end); ++row)
      for (int column = 0; column < valid_.columns; ++column)
        if (!valid_.at(column, row) && any_around(moved, column, row)) fill(column, row);
  });
}

bool CleanPlate::any_around(const std::vector<std::uint8_t>& blocks, int column, int row) const {
  for (int y = std::max(0, row - 1); y <= std::min(valid_.rows - 1, row + 1); ++y)
    for (int x = std::max(0, column - 1); x <= std::min(valid_.columns - 1, column + 1); ++x)
      if (blocks[static_cast<std::size_t>(y) * valid_.columns + x]) return true;
  return false;
}

/// Fills a block by bilinear interpolation between its own and its neighbours' central colours.
void CleanPlate::fill(int column, int row) {
  const auto color = [&](int x, int y) -> const Color& {
    x = std::clamp(x, 0, valid_.columns - 1), y = std::clamp(y, 0, valid_.rows - 1);
    return fill_colors_[static_cast<std::size_t>(y) * valid_.columns + x];
  };
  constexpr int kHalf = kBlock_px / 2, kWhole = 2 * kBlock_px;
  for (int y = 0; y < std::min(kBlock_px, picture_.height - row * kBlock_px); ++y) {
    const int above = row - (y < kHalf), down = 2 * ((y + kHalf) % kBlock_px) + 1;
    for (int x = 0; x < std::min(kBlock_px, picture_.width - column * kBlock_px); ++x) {
      const int left = column - (x < kHalf), right = 2 * ((x + kHalf) % kBlock_px) + 1;
      std::uint8_t* const pixel = picture_.at(column * kBlock_px + x, row * kBlock_px + y);
      for (int c = 0; c < 3; ++c) {
        const int top =
            color(left, above)[c] * (kWhole - right) + color(left + 1, above)[c] * right;
        const int bottom =
            color(left, above + 1)[c] * (kWhole - right) + color(left + 1, above + 1)[c] * right;
        pixel[c] = static_cast<std::uint8_t>(
            (top * (kWhole - down) + bottom * down + kWhole * kWhole / 2) / (kWhole * kWhole));
      }
    }
  }
}

}  // namespace mr::atlas
