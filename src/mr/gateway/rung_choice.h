#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "mr/core/frame.h"
#include "mr/net/viewer_transport.h"
#include "mr/rate/ladder.h"

namespace mr::gateway {

/// Who is served by which of the root's streams (docs/rate-control.md, Rungs): viewers tell the
/// rates that they want, and move once their stream is there. Stream 0 is the root's own, with the
/// highest rate; the others keep about the rates that they have, so that few viewers move when
/// others change their minds. Time is an argument.
class RungChoice {
 public:
  /// A viewer that has just moved stays for so long.
  static constexpr Duration kStay = std::chrono::seconds(5);
  /// A newcomer makes no stream of its own before: it may be about to say what it wants.
  static constexpr Duration kNew = std::chrono::seconds(1);
  /// A stream does not become richer before those have left it that want less, for so long.
  static constexpr Duration kLeave = std::chrono::seconds(8);

  /// `most_mbps`: what a viewer wants that said nothing, and the most that any may want.
  RungChoice(std::size_t streams, double most_mbps);

  void opened(net::ViewerId viewer, TimePoint now);
  void closed(net::ViewerId viewer) { viewers_.erase(viewer); }
  /// False: that is no rate, and nothing changes.
  bool want(net::ViewerId viewer, double mbps);

  /// Decides anew.
  void update(TimePoint now);
  /// The rate of each stream as of the last update(); nothing: nobody wants that stream.
  const std::vector<std::optional<double>>& rates() const { return rates_; }
  /// Who should be served by another stream, and which.
  const std::vector<std::pair<net::ViewerId, std::size_t>>& moves() const { return moves_; }

  /// The stream by which a viewer is served; 0 for one that is not known.
  std::size_t served_by(net::ViewerId viewer) const;
  void moved(net::ViewerId viewer, std::size_t stream, TimePoint now);

 private:
  struct Viewer {
    std::optional<double> wanted_mbps;
    TimePoint opened{};
    std::size_t stream = 0;
    std::optional<TimePoint> moved, leaves;  ///< leaves: since when it should
  };
  double wanted(const Viewer& viewer, TimePoint now) const;
  void assign();
  void find_moves(TimePoint now);
  bool is_raise_held(double before, TimePoint now) const;

  double most_mbps_;
  std::map<net::ViewerId, Viewer> viewers_;
  std::vector<std::optional<double>> rates_;  ///< [streams]
  std::vector<double> wanted_, ladder_;       ///< of the last update()
  std::vector<std::size_t> stream_of_;        ///< of each rung of the ladder
  std::vector<std::pair<net::ViewerId, std::size_t>> moves_;
};

}  // namespace mr::gateway
