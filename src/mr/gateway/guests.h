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

/// Who is connected, and whether they were let in: without tokens everybody, else who shows one in
/// time, until it expires. No socket, thread or clock inside.
class Guests {
 public:
  static constexpr Duration kPatience = std::chrono::seconds(10);  ///< for a token

  struct Guest {
    net::ViewerTransport* transport = nullptr;  ///< that reaches the guest
    std::string address;
    TimePoint came{};
    bool is_admitted = false;
    bool is_kept = false;                 ///< the transport was told to keep it
    std::optional<TimePoint> until = {};  ///< of the token
  };
  enum class Verdict { admitted, must_show_token, refused };
  struct Decision {
    Verdict verdict = Verdict::refused;
    std::string why;  ///< of a refusal
  };

  explicit Guests(std::optional<Tokens> tokens) : tokens_(std::move(tokens)) {}

  Decision come(net::ViewerId viewer, net::ViewerTransport& transport, const net::Visitor& visitor,
                TimePoint now);
  Decision show_token(net::ViewerId viewer, const std::string& token, TimePoint now);
  void leave(net::ViewerId viewer) { guests_.erase(viewer); }

  /// null: gone, or never there.
  Guest* find(net::ViewerId viewer);
  std::vector<std::pair<net::ViewerId, const Guest*>> admitted() const;
  /// Who showed no token in time, or whose token has expired; with the reason.
  std::vector<std::pair<net::ViewerId, std::string>> overdue(TimePoint now) const;

  /// Whether who asks for figures has a right to them. Any thread.
  bool may_look(const net::Visitor& visitor, TimePoint now) const;

 private:
  const std::optional<Tokens> tokens_;
  std::map<net::ViewerId, Guest> guests_;
};

}  // namespace mr::gateway
