#include "mr/gateway/viewer_sessions.h"

namespace mr::gateway {

ViewerSessions::Decision ViewerSessions::open(net::ViewerId viewer, net::ViewerTransport& transport,
                                              const net::Visitor& visitor, TimePoint now) {
  Session& session =
      sessions_[viewer] = {.transport = &transport, .address = visitor.address, .opened_at = now};
  if (!tokens_) {
    session.is_admitted = true;
    return {Verdict::admitted, {}};
  }
  if (!visitor.token.empty()) return show_token(viewer, visitor.token, now);
  return {Verdict::must_show_token, {}};
}

ViewerSessions::Decision ViewerSessions::show_token(net::ViewerId viewer, const std::string& token,
                                                    TimePoint now) {
  const Tokens::Answer answer = tokens_->check(token, now);
  if (answer.verdict == Tokens::Verdict::wrong) return {Verdict::refused, "wrong token"};
  if (answer.verdict == Tokens::Verdict::expired)
    return {Verdict::refused, "the token has expired"};
  Session& session = sessions_[viewer];
  session.until = answer.until;
  session.is_admitted = true;
  return {Verdict::admitted, {}};
}

ViewerSessions::Session* ViewerSessions::find(net::ViewerId viewer) {
  const auto found = sessions_.find(viewer);
  return found == sessions_.end() ? nullptr : &found->second;
}

std::vector<std::pair<net::ViewerId, const ViewerSessions::Session*>> ViewerSessions::admitted()
    const {
  std::vector<std::pair<net::ViewerId, const Session*>> out;
  for (const auto& [viewer, session] : sessions_)
    if (session.is_admitted) out.emplace_back(viewer, &session);
  return out;
}

std::vector<std::pair<net::ViewerId, std::string>> ViewerSessions::overdue(TimePoint now) const {
  std::vector<std::pair<net::ViewerId, std::string>> out;
  for (const auto& [viewer, session] : sessions_) {
    if (!session.is_admitted && now - session.opened_at > kPatience)
      out.emplace_back(viewer, "no token in time");
    if (session.until && now >= *session.until) out.emplace_back(viewer, "the token has expired");
  }
  return out;
}

bool ViewerSessions::may_read_figures(const net::Visitor& visitor, TimePoint now) const {
  return !tokens_ || tokens_->check(visitor.token, now).verdict == Tokens::Verdict::right;
}

}  // namespace mr::gateway
