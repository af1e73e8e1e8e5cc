#include "mr/node/plate_rows.h"

#include <algorithm>

namespace mr::node {
namespace {

constexpr int kStep = PlateRows::kStep;

/// The part of a block that lies in a picture.
Rect part_of(const ImageRgb& picture, int column, int row) {
  const int x = column * kStep, y = row * kStep;
  return {x, y, std::min(kStep, picture.width - x), std::min(kStep, picture.height - y)};
}

double pixels_in(const ImageRgb& picture, const Rect& part) {
  int out = 0;
  for (int y = part.y; y < part.y + part.height; ++y)
    for (int x = part.x; x < part.x + part.width; ++x) {
      const std::uint8_t* const p = picture.at(x, y);
      out += (p[0] | p[1] | p[2]) != 0;
    }
  return out;
}

bool is_same(const ImageRgb& a, const ImageRgb& b, const Rect& part) {
  for (int y = part.y; y < part.y + part.height; ++y)
    if (!std::equal(a.at(part.x, y), a.at(part.x, y) + ImageRgb::kChannels * part.width,
                    b.at(part.x, y)))
      return false;
  return true;
}

}  // namespace

void PlateRows::note_picture(const ImageRgb& before, const ImageRgb& now, int qp, bool key_frame) {
  const bool is_other = key_frame || before.width != now.width || before.height != now.height;
  columns_ = (now.width + kStep - 1) / kStep;
  blocks_.resize(static_cast<std::size_t>(columns_) * ((now.height + kStep - 1) / kStep));
  double all = 0;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const Rect part = part_of(now, static_cast<int>(i) % columns_, static_cast<int>(i) / columns_);
    const bool is_new = is_other || !is_same(before, now, part);
    blocks_[i] = {pixels_in(now, part), is_new ? qp : std::min(blocks_[i].qp, qp)};
    all += blocks_[i].share;
  }
  for (Block& block : blocks_) block.share /= std::max(all, 1.0);
}

void PlateRows::note_band(kit::RowBand band, int qp) {
  for (std::size_t i = 0; i < blocks_.size(); ++i)
    if (const int top = static_cast<int>(i) / columns_ * kStep; top >= band.first && top < band.end)
      blocks_[i].qp = std::min(blocks_[i].qp, qp);
}

double PlateRows::row_coarser_than(int qp, int row) const {
  double out = 0;
  for (int column = 0; column < columns_; ++column) {
    const Block& block = blocks_[static_cast<std::size_t>(row) * columns_ + column];
    out += block.qp > qp ? block.share : 0;
  }
  return out;
}

double PlateRows::mean_qp() const {
  double out = 0;
  for (const Block& block : blocks_) out += block.share * block.qp;
  return out;
}

double PlateRows::coarser_than(int qp) const { return coarser_than(qp, {0, rows() * kStep}); }

double PlateRows::coarser_than(int qp, kit::RowBand band) const {
  double out = 0;
  for (int row = 0; row < rows(); ++row)
    if (row * kStep >= band.first && row * kStep < band.end) out += row_coarser_than(qp, row);
  return out;
}

std::optional<kit::RowBand> PlateRows::first_coarser_than(int qp, double share) const {
  constexpr double kRounding = 1e-9;
  std::optional<kit::RowBand> out;
  double sum = 0;
  for (int row = 0; row < rows(); ++row) {
    const double coarse = row_coarser_than(qp, row);
    if (coarse <= 0) continue;
    sum += coarse;
    if (sum > share + kRounding) break;
    if (!out) out.emplace(kit::RowBand{row * kStep, row * kStep});
    out->end = (row + 1) * kStep;
  }
  return out;
}

}  // namespace mr::node
