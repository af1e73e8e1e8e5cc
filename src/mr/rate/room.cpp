#include "mr/rate/room.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "mr/rate/grid.h"
#include "mr/rate/monotone_curve.h"

namespace mr::rate {
namespace {

/// Between the quantisers of the nodes; flat beyond them.
double at_qp(const std::vector<double>& of_nodes, double qp) {
  const auto last = std::end(kPlateNodes_qp) - 1;
  const MonotoneCurve curve({std::begin(kPlateNodes_qp), std::end(kPlateNodes_qp)}, of_nodes);
  return curve.at(std::clamp<double>(qp, kPlateNodes_qp[0], *last));
}

}  // namespace

double RoomValues::plate_loss_at(double qp) const { return at_qp(plate_loss, qp); }

double RoomValues::still_loss_at(double error_voxels) const {
  const MonotoneCurve curve({std::begin(kStillNodes_voxels), std::end(kStillNodes_voxels)},
                            still_loss);
  return curve.at(
      std::clamp(error_voxels, kStillNodes_voxels[0], *std::rbegin(kStillNodes_voxels)));
}

RoomValues room_values(const Sweep& sweep) {
  RoomValues out{std::vector<double>(std::size(kPlateNodes_qp), 1),
                 std::vector<double>(std::size(kPlateNodes_qp)), 1,
                 std::vector<double>(std::size(kStillNodes_voxels))};
  for (std::size_t i = 0; i < std::size(kPlateNodes_qp); ++i)
    for (const Sweep::Plates& plates : sweep.plates)
      if (plates.qp == kPlateNodes_qp[i]) {
        out.plate_bytes[i] = std::max(plates.key_bytes, 1.0);
        out.plate_loss[i] = std::max(sweep.plates.front().ssim - plates.ssim, 0.0);
      }
  for (std::size_t i = 0; i < std::size(kStillNodes_voxels); ++i)
    for (const Sweep::Still& still : sweep.stills)
      if (std::abs(still.error_voxels - kStillNodes_voxels[i]) < 1e-3)
        out.still_loss[i] = std::max(sweep.stills.front().ssim - still.ssim, 0.0);
  if (!sweep.stills.empty()) out.still_bytes = std::max(sweep.stills.front().bytes, 1.0);
  return out;
}

double loss_of(const Backlog& backlog, const RoomValues& room, double error_voxels) {
  const double of_plates = room.plate_loss_at(backlog.plate_qp) -
                           room.plate_loss_at(std::min(backlog.best_plate_qp, backlog.plate_qp));
  const double waiting = std::min(backlog.missing_bytes / room.still_bytes, 1.0);
  return std::max(of_plates, 0.0) + waiting * room.still_loss_at(error_voxels);
}

}  // namespace mr::rate
