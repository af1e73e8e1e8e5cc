#pragma once

#include <vector>

#include "mr/rate/sweep.h"

namespace mr::rate {

/// What the still surface and its plates take and give: of a sweep, or as a model predicts it.
/// Losses are of the SSIM of whole pictures, against the finest node.
struct RoomValues {
  std::vector<double> plate_bytes;  ///< [kPlateNodes_qp] of the whole atlas, > 0
  std::vector<double> plate_loss;   ///< [kPlateNodes_qp]
  double still_bytes = 1;           ///< of the whole still surface at the finest node, > 0
  std::vector<double> still_loss;   ///< [kStillNodes_voxels]

  double plate_loss_at(double qp) const;
  double still_loss_at(double error_voxels) const;
};

/// The values of a sweep. Where it has measured neither plates nor still surface, they take and
/// lose next to nothing.
RoomValues room_values(const Sweep& sweep);

/// Still surface and plates that wait to be sent.
struct Backlog {
  double still_bytes = 0, plate_bytes = 0;
  double missing_bytes = 0;  ///< of still_bytes, of surface in whose place nothing still is shown
  double plate_qp = 0;       ///< how fine the plates are as shown, in the mean over their blocks
  double best_plate_qp = 0;  ///< how fine they are going to be

  double bytes() const { return still_bytes + plate_bytes; }
};

/// What the picture lacks while all of a backlog waits. Still surface that is missing is shown as
/// moving, with that error; what waits to take the place of other still surface lacks nothing.
double loss_of(const Backlog& backlog, const RoomValues& room, double error_voxels);

}  // namespace mr::rate
