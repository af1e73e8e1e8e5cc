#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "mr/codec/head.h"
#include "mr/gateway/rung_choice.h"
#include "mr/gateway/viewer_inbox.h"
#include "mr/gateway/viewer_sessions.h"
#include "mr/gateway/viewers.h"
#include "mr/net/viewer_transport.h"
#include "mr/node/node_clock.h"
#include "mr/node/presence.h"
#include "mr/node/task.h"
#include "mr/scene/scene.h"

namespace mr::gateway {

/// Sends the root's stream, or a rung of it at a lower rate, to viewers over the attached
/// transports (docs/wire-format.md). If the scene has tokens, a viewer without one receives nothing
/// about the scene. A Task: no socket and no thread inside, and the time is an argument.
class Gateway final : public node::Task {
 public:
  struct Options {
    std::optional<Tokens> tokens = {};  ///< none: every viewer is admitted
    /// Warns also when the root sends nothing from the start: another process runs it.
    bool expects_root = false;
    /// Whether all recordings of the scene have ended. Any thread.
    std::function<bool()> has_ended = [] { return false; };
  };
  static constexpr const char* kName = "gateway";

  /// The scene must outlive the gateway.
  Gateway(const Scene& scene, node::NodeLog log, Options options);
  ~Gateway() override;

  /// Adds a transport by which viewers connect. It must outlive every step. `clock` stamps the
  /// messages of viewers on arrival.
  void attach(net::ViewerTransport& transport, node::Clock clock);
  /// Whether a visitor may read the monitoring figures. Any thread.
  bool may_read_figures(const net::Visitor& visitor, TimePoint now) const {
    return sessions_.may_read_figures(visitor, now);
  }

  const std::string& id() const override { return id_; }
  /// The root, then its rungs.
  std::vector<std::string> inputs() const override;
  std::vector<node::Ask> step(const node::Arrivals& arrivals, TimePoint now) override;
  Bytes answer(const codec::Control&, TimePoint) override { return {}; }
  void wake_by(std::function<void()> wake) override;
  node::NodeStats stats(TimePoint now) const override;

 private:
  using Event = ViewerInbox::Event;
  /// One of the root's streams.
  struct Stream {
    Stream(const std::string& scene, std::string of) : node(std::move(of)), heads(scene, node) {}
    std::string node;
    codec::HeadReader heads;
    Viewers viewers;
    double target_mbps = 0;  ///< as the root was told
    std::optional<TimePoint> target_told;
    std::optional<TimePoint> begun;  ///< its first packet since it is wanted
  };
  Viewers& viewers_of(net::ViewerId viewer) { return streams_[choice_.served_by(viewer)].viewers; }
  void take_packet(Stream& stream, const net::Message& bytes, Packet packet, TimePoint now);
  void note_root(const Packet& packet, const net::Message& bytes, TimePoint now);
  /// The root's own stream is there in any case.
  bool is_wanted(const Stream& stream) const {
    return stream.target_told || &stream == &streams_.front();
  }
  void greet(const Stream& stream);
  bool can_follow() const;
  void close(net::ViewerId viewer);
  void move_viewers(TimePoint now);
  bool can_take(const Stream& stream, const Stream& before, TimePoint now) const;
  std::size_t unread_bytes() const;
  void on_event(const Event& event, TimePoint now);
  void on_decision(net::ViewerId viewer, const ViewerSessions::Decision& decision, TimePoint now);
  void on_text(net::ViewerId viewer, const std::string& text, TimePoint now);
  void on_request(net::ViewerId viewer, std::span<const std::byte> bytes, TimePoint now);
  void on_target(net::ViewerId viewer, const nlohmann::ordered_json& wanted);
  void ask_for_rates(TimePoint now, std::vector<node::Ask>& out);
  void refuse(net::ViewerId viewer, const std::string& why);
  void close_overdue(TimePoint now);
  void log_refusals(TimePoint now);
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
  std::string id_ = kName;
  std::shared_ptr<ViewerInbox> inbox_ = std::make_shared<ViewerInbox>();  // transports push to it
  mutable std::mutex mutex_;  // guards the members below: stats() is called from any thread
  std::vector<net::ViewerTransport*> transports_;
  ViewerSessions sessions_;
  std::deque<Stream> streams_;  ///< as inputs()
  RungChoice choice_;
  node::Presence sensors_;
  bool is_silent_ = false;                         ///< of the root, and viewers were informed
  std::map<std::string, std::uint64_t> refusals_;  ///< by cause, of the transports; as last logged
  std::optional<TimePoint> refusals_logged_, version_refused_, first_step_, last_packet_,
      give_back_at_;
  Duration interval_{};          ///< between the last two packets
  std::size_t most_unread_ = 0;  ///< bytes, since memory was given back
  std::optional<std::uint64_t> acknowledged_;
  std::atomic<std::uint64_t> frames_ = 0, bytes_ = 0;
  DropCounter drops_;
};

}  // namespace mr::gateway
