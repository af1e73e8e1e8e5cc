#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <vector>

#include "mr/net/viewer_transport.h"
#include "mr/rate/ladder.h"

namespace mr::gateway {

/// Who is served by which of the root's streams (docs/rate-control.md, Rungs): viewers tell the
/// rates that they want, and move once their stream is there. Rung 0 is the root's own stream, with
/// the highest rate. No clock inside.
class RungChoice {
 public:
  /// `most_mbps`: what a viewer wants that said nothing, and the most that any may want.
  RungChoice(std::size_t most_rungs, double most_mbps)
      : most_rungs_(most_rungs), most_mbps_(most_mbps) {}

  void opened(net::ViewerId viewer);
  void closed(net::ViewerId viewer);
  /// False: that is no rate, and nothing changes.
  bool want(net::ViewerId viewer, double mbps);

  /// The rates of the rungs, falling; where nobody watches, the most of rung 0.
  const std::vector<double>& ladder();
  /// The rung by which a viewer is served; 0 for one that is not known.
  std::size_t served_by(net::ViewerId viewer) const;
  /// Who should be served by another rung, and which.
  std::vector<std::pair<net::ViewerId, std::size_t>> moves();
  void moved(net::ViewerId viewer, std::size_t rung) { viewers_.at(viewer).rung = rung; }

 private:
  struct Viewer {
    double wanted_mbps = 0;
    std::size_t rung = 0;
  };
  std::size_t most_rungs_;
  double most_mbps_;
  std::map<net::ViewerId, Viewer> viewers_;
  std::vector<double> ladder_;  ///< empty: to be made anew
};

}  // namespace mr::gateway
