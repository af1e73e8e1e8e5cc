#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "mr/core/image.h"
#include "mr/kit/video.h"

namespace mr::node {

/// How finely the blocks of the atlas of clean plates were sent, squares of kStep, and which rows
/// of them are to be sent again. A block's share of the picture is that of its pixels that are not
/// black.
class PlateRows {
 public:
  static constexpr int kStep = kit::VideoEncoder::kBandStep;

  /// The whole picture was sent with a quantiser. What changed, and all of a key frame, is as fine
  /// as that now; the rest, at least. `before`: the picture of the unit before, of any size.
  void note_picture(const ImageRgb& before, const ImageRgb& now, int qp, bool key_frame);
  /// A band of it was.
  void note_band(kit::RowBand band, int qp);

  /// The mean of the blocks' quantisers, by their share; 0 of no picture.
  double mean_qp() const;
  /// 0..1: the share of the blocks that were sent more coarsely.
  double coarser_than(int qp) const;
  double coarser_than(int qp, kit::RowBand band) const;
  /// The first rows that have some, as many as have at most this share together; nothing: not even
  /// one row.
  std::optional<kit::RowBand> first_coarser_than(int qp, double share) const;

 private:
  struct Block {
    double share = 0;
    int qp = 0;
  };
  int rows() const { return columns_ > 0 ? static_cast<int>(blocks_.size()) / columns_ : 0; }
  double row_coarser_than(int qp, int row) const;

  int columns_ = 0;
  std::vector<Block> blocks_;  ///< row by row
};

}  // namespace mr::node
