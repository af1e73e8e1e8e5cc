#pragma once

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <utility>

namespace mr::net {

/// An IPv4 address that comes as an IPv6 one, as it is; others unchanged.
inline boost::asio::ip::address unmapped(const boost::asio::ip::address& address) {
  namespace ip = boost::asio::ip;
  if (!address.is_v6() || !address.to_v6().is_v4_mapped()) return address;
  return ip::make_address_v4(ip::v4_mapped, address.to_v6());
}

/// Whom a connection is counted for: its IPv4 address, or the /64 network of its IPv6 address, of
/// which one subscriber has as many addresses as it likes.
inline std::string peer_of(const boost::asio::ip::address& mapped) {
  namespace ip = boost::asio::ip;
  const ip::address address = unmapped(mapped);
  if (!address.is_v6()) return address.to_string();
  const ip::address_v6 v6 = address.to_v6();
  auto bytes = v6.to_bytes();
  std::fill(bytes.begin() + 8, bytes.end(), 0);
  return v6.is_loopback() ? v6.to_string() : ip::address_v6(bytes).to_string() + "/64";
}

/// A bounded number of places, some of them for each peer: nobody can take all there are. Where
/// there is none left, whoever has come first and has not settled gives up its place. Not
/// thread-safe.
class Places {
  struct State;
  struct Entry {
    std::string peer;
    std::function<void()> give_up;
    bool is_settled = false;
  };
  using Entries = std::list<Entry>;

 public:
  struct Limits {
    int all = 0, per_peer = 0;
  };

  /// One place, until it is destroyed.
  class Place {
   public:
    ~Place() { leave(); }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    /// It is not given up for others any more.
    void settle() {
      if (has_left_) return;
      entry_->is_settled = true;
    }
    const std::string& peer() const { return peer_; }

   private:
    friend class Places;
    Place(std::shared_ptr<State> state, std::string peer)
        : state_(std::move(state)), peer_(std::move(peer)) {}
    void leave() {
      if (std::exchange(has_left_, true)) return;
      if (--state_->of_peer[peer_] == 0) state_->of_peer.erase(peer_);
      state_->entries.erase(entry_);
    }

    std::shared_ptr<State> state_;
    std::string peer_;
    Entries::iterator entry_;
    bool has_left_ = false;
  };

  explicit Places(const Limits& limits) : limits_(limits) {}

  /// Null where there is none. `give_up` ends what holds the place, now or soon; the place itself
  /// is free at once.
  std::shared_ptr<Place> take(const std::string& peer, std::function<void()> give_up) {
    const auto of_peer = state_->of_peer.find(peer);
    if (of_peer != state_->of_peer.end() && of_peer->second >= limits_.per_peer) {
      if (!free_one([&](const Entry& entry) { return entry.peer == peer; })) return nullptr;
    } else if (size() >= limits_.all && !free_one([](const Entry&) { return true; })) {
      return nullptr;
    }
    std::shared_ptr<Place> place(new Place(state_, peer));
    state_->entries.push_back({peer, nullptr, false});
    place->entry_ = std::prev(state_->entries.end());
    place->entry_->give_up = [weak = std::weak_ptr(place), give_up = std::move(give_up)] {
      if (const auto held = weak.lock()) held->leave();
      give_up();
    };
    ++state_->of_peer[peer];
    return place;
  }

  int size() const { return static_cast<int>(state_->entries.size()); }

 private:
  struct State {
    Entries entries;  ///< oldest first
    std::map<std::string, int> of_peer;
  };

  template <typename F>
  bool free_one(F may_go) {
    for (const Entry& entry : state_->entries) {
      if (entry.is_settled || !may_go(entry)) continue;
      const auto give_up = entry.give_up;  // which erases the entry
      give_up();
      return true;
    }
    return false;
  }

  const Limits limits_;
  std::shared_ptr<State> state_ = std::make_shared<State>();
};

}  // namespace mr::net
