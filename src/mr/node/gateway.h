#pragma once

#include <memory>
#include <string>
#include <vector>

#include "mr/codec/head.h"
#include "mr/core/result.h"
#include "mr/net/web_server.h"
#include "mr/node/live_node.h"
#include "mr/node/viewer_inbox.h"
#include "mr/node/viewers.h"

namespace mr::node {

/// Brings the root's stream to browsers: serves the page, and a WebSocket per viewer
/// (docs/wire-format.md). One thread decides; the web server has another one.
class Gateway final : public LiveNode {
 public:
  /// `page`: folder of the built viewer. io: the address cannot be listened on.
  static Result<std::unique_ptr<Gateway>> start(const LiveContext& context,
                                                const GatewayConfig& config,
                                                const std::filesystem::path& page);
  ~Gateway() override;

  int port() const { return server_->port(); }
  LiveStats stats() const override;

 private:
  using Event = ViewerInbox::Event;
  struct Inbox;

  explicit Gateway(const LiveContext& context);
  void listen_to_root();
  void run(const std::stop_token& stop);
  void take_packets(TimePoint now);
  void take_events();
  void on_event(const Event& event);
  void on_text(net::ClientId viewer, const std::string& text);
  void on_request(net::ClientId viewer, std::span<const std::byte> bytes);
  void ask_root(TimePoint now);
  void send_request(const codec::Request& request);
  void acknowledge();
  void watch_silence(TimePoint now);
  void send(std::vector<Viewers::Send> messages);
  std::string hello() const;

  LiveContext context_;
  std::string root_;
  std::shared_ptr<Inbox> inbox_;
  mutable std::mutex mutex_;  // guards viewers_ for stats()
  Viewers viewers_;
  std::vector<net::ClientId> clients_;
  codec::HeadReader heads_;
  std::optional<TimePoint> last_packet_, head_asked_;
  std::optional<std::uint64_t> acknowledged_;
  std::uint32_t epoch_ = 0;
  bool stopped_ = false;
  std::atomic<std::uint64_t> frames_ = 0;
  DropCounter drops_;
  std::unique_ptr<net::Subscription> subscription_;
  std::unique_ptr<net::WebServer> server_;
  std::jthread thread_;  // last: it uses what is above
};

}  // namespace mr::node
