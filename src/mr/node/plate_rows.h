#pragma once

#include <optional>
#include <vector>

#include "mr/core/image.h"
#include "mr/kit/video.h"

namespace mr::node {

/// How finely the rows of the atlas of clean plates were sent, in steps of kStep, and which are to
/// be sent again. A row's share of the picture is that of its pixels that are not black.
class PlateRows {
 public:
  static constexpr int kStep = kit::VideoEncoder::kBandStep;

  /// The whole picture was sent with a quantiser. What changed, and all of a key frame, is as fine
  /// as that now; the rest, at least. `before`: the picture of the unit before, of any size.
  void note_picture(const ImageRgb& before, const ImageRgb& now, int qp, bool key_frame);
  /// A band of it was.
  void note_band(kit::RowBand band, int qp);

  /// 0..1: the share of the rows that were sent more coarsely.
  double coarser_than(int qp) const;
  double coarser_than(int qp, kit::RowBand band) const;
  /// The first of them, as many as have at most this share together; nothing: not even one row.
  std::optional<kit::RowBand> first_coarser_than(int qp, double share) const;

 private:
  struct Row {
    double share = 0;
    int qp = 0;
  };
  std::vector<Row> rows_;
};

}  // namespace mr::node
