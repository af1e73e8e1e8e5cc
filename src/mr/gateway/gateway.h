#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "mr/codec/head.h"
#include "mr/gateway/guests.h"
#include "mr/gateway/viewer_inbox.h"
#include "mr/gateway/viewers.h"
#include "mr/net/viewer_transport.h"
#include "mr/node/node_clock.h"
#include "mr/node/presence.h"
#include "mr/node/task.h"
#include "mr/scene/scene.h"

namespace mr::gateway {

/// Brings the root's stream to viewers, by whatever transports are attached (docs/wire-format.md).
/// Where there are tokens, nobody is told anything of the scene without one. A Task: no socket and
/// no thread inside, and the time is an argument.
class Gateway final : public node::Task {
 public:
  struct Options {
    std::optional<Tokens> tokens = {};  ///< none: anybody may watch
    /// Silence of the root is told from the start on: it may never have been started.
    bool expects_root = false;
    /// Whether all recordings of the scene have ended. Any thread.
    std::function<bool()> has_ended = [] { return false; };
  };
  static constexpr const char* kName = "gateway";

  /// The scene must outlive it.
  Gateway(const Scene& scene, node::NodeLog log, Options options);
  ~Gateway() override;

  /// Lets viewers in by a transport, which must outlive every step. `clock`: when they say
  /// something.
  void attach(net::ViewerTransport& transport, node::Clock clock);
  /// Whether who asks for figures has a right to them. Any thread.
  bool may_look(const net::Visitor& visitor, TimePoint now) const {
    return guests_.may_look(visitor, now);
  }

  const std::string& id() const override { return id_; }
  std::vector<std::string> inputs() const override { return {root_}; }
  std::vector<node::Ask> step(const node::Arrivals& arrivals, TimePoint now) override;
  Bytes answer(const codec::Control&, TimePoint) override { return {}; }
  void wake_by(std::function<void()> wake) override;
  node::NodeStats stats(TimePoint now) const override;

 private:
  using Event = ViewerInbox::Event;
  void take_packet(const net::Message& bytes, Packet packet, TimePoint now);
  void on_event(const Event& event, TimePoint now);
  void on_decision(net::ViewerId viewer, const Guests::Decision& decision);
  void on_text(net::ViewerId viewer, const std::string& text, TimePoint now);
  void on_request(net::ViewerId viewer, std::span<const std::byte> bytes, TimePoint now);
  void refuse(net::ViewerId viewer, const std::string& why);
  void close_overdue(TimePoint now);
  void tell_refusals(TimePoint now);
  void give_memory_back(TimePoint now);
  std::vector<node::Ask> asks(TimePoint now);
  void watch_silence(TimePoint now);
  void send(std::vector<Viewers::Send> messages);
  void send_text(net::ViewerId viewer, const std::string& text);
  void send_to_all(const std::string& text);
  std::map<std::string, std::uint64_t> transport_drops() const;
  std::string hello() const;

  const Scene* scene_;
  node::NodeLog log_;
  Options options_;
  std::string id_ = kName, root_;
  std::shared_ptr<ViewerInbox> inbox_ = std::make_shared<ViewerInbox>();  // transports push to it
  mutable std::mutex mutex_;  // of what follows, for stats()
  std::vector<net::ViewerTransport*> transports_;
  Guests guests_;
  Viewers viewers_;
  node::Presence sensors_;
  bool is_silent_ = false;  ///< which was told
  codec::HeadReader heads_;
  std::map<std::string, std::uint64_t> refusals_;  ///< of the transports, that were told
  std::optional<TimePoint> refusals_told_, first_step_, last_packet_, give_back_at_;
  Duration interval_{};          ///< between the last two packets
  std::size_t most_unread_ = 0;  ///< since memory was given back
  std::optional<std::uint64_t> acknowledged_;
  std::atomic<std::uint64_t> frames_ = 0, bytes_ = 0;
  DropCounter drops_;
};

}  // namespace mr::gateway
