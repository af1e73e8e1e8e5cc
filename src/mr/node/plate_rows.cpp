#include "mr/node/plate_rows.h"

#include <algorithm>
#include <span>

namespace mr::node {
namespace {

/// The pixels of a step of rows; of the last one, what there is.
std::span<const std::uint8_t> step_of(const ImageRgb& picture, std::size_t step) {
  const std::size_t row = static_cast<std::size_t>(picture.width) * ImageRgb::kChannels;
  const std::size_t first = step * PlateRows::kStep * row;
  return std::span(picture.data)
      .subspan(first, std::min(PlateRows::kStep * row, picture.data.size() - first));
}

double pixels_in(std::span<const std::uint8_t> step) {
  std::size_t out = 0;
  for (std::size_t i = 0; i + 2 < step.size(); i += 3)
    out += (step[i] | step[i + 1] | step[i + 2]) != 0;
  return static_cast<double>(out);
}

}  // namespace

void PlateRows::note_picture(const ImageRgb& before, const ImageRgb& now, int qp, bool key_frame) {
  const bool is_other = key_frame || before.width != now.width || before.height != now.height;
  rows_.resize(static_cast<std::size_t>((now.height + kStep - 1) / kStep));
  double all = 0;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const auto pixels = step_of(now, i);
    const bool is_new = is_other || !std::ranges::equal(pixels, step_of(before, i));
    rows_[i] = {pixels_in(pixels), is_new ? qp : std::min(rows_[i].qp, qp)};
    all += rows_[i].share;
  }
  for (Row& row : rows_) row.share /= std::max(all, 1.0);
}

void PlateRows::note_band(kit::RowBand band, int qp) {
  for (std::size_t i = 0; i < rows_.size(); ++i)
    if (const int top = static_cast<int>(i) * kStep; top >= band.first && top < band.end)
      rows_[i].qp = std::min(rows_[i].qp, qp);
}

double PlateRows::coarser_than(int qp) const {
  return coarser_than(qp, {0, static_cast<int>(rows_.size()) * kStep});
}

double PlateRows::coarser_than(int qp, kit::RowBand band) const {
  double out = 0;
  for (std::size_t i = 0; i < rows_.size(); ++i)
    if (const int top = static_cast<int>(i) * kStep; top >= band.first && top < band.end)
      out += rows_[i].qp > qp ? rows_[i].share : 0;
  return out;
}

std::optional<kit::RowBand> PlateRows::first_coarser_than(int qp, double share) const {
  constexpr double kRounding = 1e-9;
  std::optional<kit::RowBand> out;
  double sum = 0;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    if (rows_[i].qp <= qp || rows_[i].share <= 0) continue;
    sum += rows_[i].share;
    if (sum > share + kRounding) break;
    const int top = static_cast<int>(i) * kStep;
    if (!out) out.emplace(kit::RowBand{top, top});
    out->end = top + kStep;
  }
  return out;
}

}  // namespace mr::node
