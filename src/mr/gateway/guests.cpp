#include "mr/gateway/guests.h"

namespace mr::gateway {

Guests::Decision Guests::come(net::ViewerId viewer, net::ViewerTransport& transport,
                              const net::Visitor& visitor, TimePoint now) {
  Guest& guest =
      guests_[viewer] = {.transport = &transport, .address = visitor.address, .came = now};
  if (!tokens_) {
    guest.is_admitted = true;
    return {Verdict::admitted, {}};
  }
  if (!visitor.token.empty()) return show_token(viewer, visitor.token, now);
  return {Verdict::must_show_token, {}};
}

Guests::Decision Guests::show_token(net::ViewerId viewer, const std::string& token, TimePoint now) {
  const Tokens::Answer answer = tokens_->check(token, now);
  if (answer.verdict == Tokens::Verdict::wrong) return {Verdict::refused, "wrong token"};
  if (answer.verdict == Tokens::Verdict::expired)
    return {Verdict::refused, "the token has expired"};
  Guest& guest = guests_[viewer];
  guest.until = answer.until;
  guest.is_admitted = true;
  return {Verdict::admitted, {}};
}

Guests::Guest* Guests::find(net::ViewerId viewer) {
  const auto found = guests_.find(viewer);
  return found == guests_.end() ? nullptr : &found->second;
}

std::vector<std::pair<net::ViewerId, const Guests::Guest*>> Guests::admitted() const {
  std::vector<std::pair<net::ViewerId, const Guest*>> out;
  for (const auto& [viewer, guest] : guests_)
    if (guest.is_admitted) out.emplace_back(viewer, &guest);
  return out;
}

std::vector<std::pair<net::ViewerId, std::string>> Guests::overdue(TimePoint now) const {
  std::vector<std::pair<net::ViewerId, std::string>> out;
  for (const auto& [viewer, guest] : guests_) {
    if (!guest.is_admitted && now - guest.came > kPatience)
      out.emplace_back(viewer, "no token in time");
    if (guest.until && now >= *guest.until) out.emplace_back(viewer, "the token has expired");
  }
  return out;
}

bool Guests::may_look(const net::Visitor& visitor, TimePoint now) const {
  return !tokens_ || tokens_->check(visitor.token, now).verdict == Tokens::Verdict::right;
}

}  // namespace mr::gateway
