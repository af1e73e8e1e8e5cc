#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mr/gateway/tokens.h"
#include "mr/net/viewer_transport.h"

namespace mr::gateway {

/// The connected viewers and their access control: without tokens every viewer is admitted, else
/// each viewer that shows a valid token in time, until the token expires. No socket, thread or
/// clock inside.
class ViewerSessions {
 public:
  static constexpr Duration kPatience =
      std::chrono::seconds(10);  ///< wait for a token before the viewer is refused

  struct Session {
    net::ViewerTransport* transport = nullptr;  ///< that reaches the viewer; not owned
    std::string address;
    TimePoint opened_at{};
    bool is_admitted = false;
    bool is_kept = false;                 ///< the transport was asked to pin its connection
    std::optional<TimePoint> until = {};  ///< when the token expires; none: never
  };
  enum class Verdict { admitted, must_show_token, refused };
  struct Decision {
    Verdict verdict = Verdict::refused;
    std::string why;  ///< reason for a refusal
  };

  explicit ViewerSessions(std::optional<Tokens> tokens) : tokens_(std::move(tokens)) {}

  /// Records a new connection and checks the token that came with it, if any.
  Decision open(net::ViewerId viewer, net::ViewerTransport& transport, const net::Visitor& visitor,
                TimePoint now);
  /// Checks the token that an open session shows.
  Decision show_token(net::ViewerId viewer, const std::string& token, TimePoint now);
  void close(net::ViewerId viewer) { sessions_.erase(viewer); }

  /// null: the session is closed or never existed.
  Session* find(net::ViewerId viewer);
  std::vector<std::pair<net::ViewerId, const Session*>> admitted() const;
  /// The sessions to be closed, each with the reason: no token in time, or an expired one.
  std::vector<std::pair<net::ViewerId, std::string>> overdue(TimePoint now) const;

  /// Whether a visitor may read the monitoring figures. Any thread.
  bool may_read_figures(const net::Visitor& visitor, TimePoint now) const;

 private:
  const std::optional<Tokens> tokens_;
  std::map<net::ViewerId, Session> sessions_;
};

}  // namespace mr::gateway
