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

/// An IPv4-mapped IPv6 address (::ffff:a.b.c.d) as IPv4; others unchanged.
inline boost::asio::ip::address unmapped(const boost::asio::ip::address& address) {
  namespace ip = boost::asio::ip;
  if (!address.is_v6() || !address.to_v6().is_v4_mapped()) return address;
  return ip::make_address_v4(ip::v4_mapped, address.to_v6());
}

/// The peer that a connection counts for: its IPv4 address, or the /64 network of its IPv6 address,
/// since one subscriber usually owns a whole /64.
inline std::string peer_of(const boost::asio::ip::address& mapped) {
  namespace ip = boost::asio::ip;
  const ip::address address = unmapped(mapped);
  if (!address.is_v6()) return address.to_string();
  const ip::address_v6 v6 = address.to_v6();
  auto bytes = v6.to_bytes();
  std::fill(bytes.begin() + 8, bytes.end(), 0);
  return v6.is_loopback() ? v6.to_string() : ip::address_v6(bytes).to_string() + "/64";
}

/// Bounds the number of connections, in all and per peer, so that no peer can exhaust them. When
/// there is no free slot, the oldest connection that is not pinned is evicted. Not thread-safe.
class ConnectionQuota {
  struct State;
  struct Entry {
    std::string peer;
    std::function<void()> evict;
    bool is_pinned = false;
  };
  using Entries = std::list<Entry>;

 public:
  struct Limits {
    int all = 0, per_peer = 0;
  };

  /// One connection's slot, released by its destructor.
  class Slot {
   public:
    ~Slot() { release(); }
    Slot(const Slot&) = delete;
    Slot& operator=(const Slot&) = delete;
    /// From now on the slot is not evicted.
    void pin() {
      if (is_released_) return;
      entry_->is_pinned = true;
    }
    const std::string& peer() const { return peer_; }

   private:
    friend class ConnectionQuota;
    Slot(std::shared_ptr<State> state, std::string peer)
        : state_(std::move(state)), peer_(std::move(peer)) {}
    void release() {
      if (std::exchange(is_released_, true)) return;
      if (--state_->of_peer[peer_] == 0) state_->of_peer.erase(peer_);
      state_->entries.erase(entry_);
    }

    std::shared_ptr<State> state_;
    std::string peer_;
    Entries::iterator entry_;
    bool is_released_ = false;
  };

  explicit ConnectionQuota(const Limits& limits) : limits_(limits) {}

  /// A slot for a connection of `peer`; null when none is free and none can be evicted. `evict` is
  /// called when it is evicted and must end the connection, now or soon; the slot is free at once.
  std::shared_ptr<Slot> acquire(const std::string& peer, std::function<void()> evict) {
    const auto of_peer = state_->of_peer.find(peer);
    if (of_peer != state_->of_peer.end() && of_peer->second >= limits_.per_peer) {
      if (!evict_one([&](const Entry& entry) { return entry.peer == peer; })) return nullptr;
    } else if (size() >= limits_.all && !evict_one([](const Entry&) { return true; })) {
      return nullptr;
    }
    std::shared_ptr<Slot> slot(new Slot(state_, peer));
    state_->entries.push_back({peer, nullptr, false});
    slot->entry_ = std::prev(state_->entries.end());
    slot->entry_->evict = [weak = std::weak_ptr(slot), evict = std::move(evict)] {
      if (const auto held = weak.lock()) held->release();
      evict();
    };
    ++state_->of_peer[peer];
    return slot;
  }

  int size() const { return static_cast<int>(state_->entries.size()); }

 private:
  struct State {
    Entries entries;  ///< oldest first
    std::map<std::string, int> of_peer;
  };

  template <typename F>
  bool evict_one(F may_evict) {
    for (const Entry& entry : state_->entries) {
      if (entry.is_pinned || !may_evict(entry)) continue;
      const auto evict = entry.evict;  // which erases the entry
      evict();
      return true;
    }
    return false;
  }

  const Limits limits_;
  std::shared_ptr<State> state_ = std::make_shared<State>();
};

}  // namespace mr::net
