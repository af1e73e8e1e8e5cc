#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mr/codec/head.h"
#include "mr/core/result.h"
#include "mr/net/web_server.h"
#include "mr/node/live_node.h"
#include "mr/node/presence.h"
#include "mr/node/tokens.h"
#include "mr/node/viewer_inbox.h"
#include "mr/node/viewers.h"

namespace mr::node {

/// Brings the root's stream to browsers: serves the page, and a WebSocket per viewer
/// (docs/wire-format.md). Where there are tokens, nobody is told anything of the scene without one.
/// One thread decides; the web server has another one.
class Gateway final : public LiveNode {
 public:
  /// `page`: folder of the built viewer. io: the address cannot be listened on. Others: see
  /// FrontDoor.
  static Result<std::unique_ptr<Gateway>> start(const LiveContext& context,
                                                const GatewayConfig& config,
                                                const std::filesystem::path& page);
  ~Gateway() override;

  int port() const { return server_->port(); }
  LiveStats stats() const override;

 private:
  using Event = ViewerInbox::Event;
  struct Inbox;
  /// Somebody who is connected.
  struct Guest {
    std::string address;
    TimePoint came{};
    bool is_admitted = false, is_kept = false;
    std::optional<TimePoint> until;  ///< of the token
  };

  Gateway(const LiveContext& context, std::optional<Tokens> tokens);
  net::WebHandlers handlers();
  void listen_to_root();
  void run(const std::stop_token& stop);
  void take_packets(TimePoint now);
  void take_packet(const net::Message& bytes, Packet packet, TimePoint now);
  void take_answers();
  void take_events(TimePoint now);
  void on_event(const Event& event, TimePoint now);
  void on_opened(net::ClientId viewer, const net::WebVisitor& visitor, TimePoint now);
  void on_token(net::ClientId viewer, const std::string& token, TimePoint now);
  void admit(net::ClientId viewer);
  void on_text(net::ClientId viewer, const std::string& text, TimePoint now);
  void on_request(net::ClientId viewer, std::span<const std::byte> bytes, TimePoint now);
  void refuse(net::ClientId viewer, const std::string& why);
  void close_overdue(TimePoint now);
  void tell_refusals(TimePoint now);
  void give_memory_back(TimePoint now);
  void ask_root(TimePoint now);
  void send_request(const codec::Request& request);
  void acknowledge();
  void watch_silence(TimePoint now);
  void send(std::vector<Viewers::Send> messages);
  void send_to_all(const std::string& text);
  bool may_look(const net::WebVisitor& visitor) const;
  std::string hello() const;

  LiveContext context_;
  std::string root_;
  const std::optional<Tokens> tokens_;
  std::shared_ptr<Inbox> inbox_;
  mutable std::mutex mutex_;  // guards the next for stats()
  Viewers viewers_;
  Presence sensors_;
  bool stopped_ = false;
  std::map<net::ClientId, Guest> guests_;
  codec::HeadReader heads_;
  std::map<std::string, std::uint64_t> refusals_;  ///< of the web server, that were told
  std::optional<TimePoint> refusals_told_;
  std::optional<TimePoint> last_packet_, head_asked_, give_back_at_;
  const TimePoint started_ = wall_time();
  Duration interval_{};          ///< between the last two packets
  std::size_t most_unread_ = 0;  ///< since memory was given back
  std::optional<std::uint64_t> acknowledged_;
  std::atomic<std::uint64_t> frames_ = 0, bytes_ = 0;
  DropCounter drops_;
  std::unique_ptr<net::Subscription> subscription_;
  std::unique_ptr<net::WebServer> server_;
  std::jthread thread_;  // last: it uses what is above
};

}  // namespace mr::node
