#include "mr/gateway/gateway.h"

#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <utility>

#include "mr/codec/packet_codec.h"
#include "mr/codec/stream_receiver.h"
#include "mr/node/rungs.h"

namespace mr::gateway {
namespace {

using Json = nlohmann::ordered_json;

constexpr Duration kSilence =
    std::chrono::milliseconds(1500);  // of the root, then viewers are informed
constexpr Duration kLongestSilence = std::chrono::seconds(10);  // limit where packets are far apart
constexpr Duration kLogEvery = std::chrono::seconds(1);         // what happens again and again
constexpr Duration kTargetEvery = std::chrono::seconds(1);      // the root is told
constexpr std::size_t kMaxText = 1024;                          // bytes of a viewer's text message
constexpr std::size_t kMaxSensorsNamed = 256;                   // in a hello

Json json_of(const Vec3d& v) { return {v.x, v.y, v.z}; }

/// The scene's sensors in their order, so that a packet's sensor numbers have names.
Json sensor_names(const Scene& scene) {
  Json names = Json::array();
  for (const SensorConfig& sensor : scene.sensors)
    if (names.size() < kMaxSensorsNamed) names.push_back(sensor.id);
  return names;
}

}  // namespace

Gateway::Gateway(const Scene& scene, node::NodeLog log, Options options)
    : scene_(&scene),
      log_(std::move(log)),
      options_(std::move(options)),
      sessions_(std::move(options_.tokens)),
      choice_(1 + node::rung_names(scene).size(), scene.rate.target_mbps),
      sensors_(scene.sensors.size()) {
  for (const std::string& node : inputs()) streams_.emplace_back(scene.id, node);
  drops_.set_listener(log_.dropped);
}

Gateway::~Gateway() = default;

std::vector<std::string> Gateway::inputs() const {
  std::vector<std::string> out = node::rung_names(*scene_);
  out.insert(out.begin(), scene_->mergers.back().id);
  return out;
}

void Gateway::wake_by(std::function<void()> wake) { inbox_->wake_by(std::move(wake)); }

void Gateway::attach(net::ViewerTransport& transport, node::Clock clock) {
  {
    const std::lock_guard lock(mutex_);
    transports_.push_back(&transport);
  }
  transport.run(
      {.opened = [inbox = inbox_, to = &transport](
                     net::ViewerId viewer,
                     const net::Visitor& visitor) { inbox->opened(viewer, *to, visitor); },
       .received = [inbox = inbox_, clock = std::move(clock)](
                       net::ViewerId viewer, std::span<const std::byte> bytes,
                       bool is_text) { return inbox->received(viewer, bytes, is_text, clock()); },
       .writable = [inbox = inbox_](net::ViewerId viewer) { inbox->written(viewer); },
       .closed = [inbox = inbox_](net::ViewerId viewer) { inbox->closed(viewer); }});
}

std::vector<node::Ask> Gateway::step(const node::Arrivals& arrivals, TimePoint now) {
  const std::lock_guard lock(mutex_);
  if (!first_step_) first_step_ = now;
  for (const Event& event : inbox_->take()) on_event(event, now);
  for (const auto& [input, bytes] : arrivals.packets) {
    Stream& stream = streams_[input];
    if (!is_wanted(stream)) continue;  // what was on its way
    auto packet = stream.heads.read(*bytes, now);
    packet ? take_packet(stream, bytes, *std::move(packet), now)
           : drops_.count(stream.node + " → gateway", packet.error());
  }
  for (const node::Arrivals::Answer& answer : arrivals.answers) {
    if (!is_wanted(streams_[answer.input])) continue;
    auto chunks = codec::read_answer(*answer.bytes);
    chunks ? streams_[answer.input].viewers.take_chunks(*std::move(chunks))
           : drops_.count(streams_[answer.input].node + " → gateway", chunks.error());
  }
  move_viewers(now);
  close_overdue(now);
  log_refusals(now);
  give_memory_back(now);
  watch_silence(now);
  return asks(now);
}

void Gateway::take_packet(Stream& stream, const net::Message& bytes, Packet packet, TimePoint now) {
  const bool is_root = &stream == &streams_.front();
  if (stream.heads.began_afresh()) {
    stream.viewers.begin_afresh();
    stream.begun.reset();
    if (is_root) acknowledged_.reset();
    if (!is_root || frames_ > 0) greet(stream);
  }
  if (!stream.begun) stream.begun = now;
  if (is_root) note_root(packet, bytes, now);
  send(stream.viewers.packet(std::move(packet), bytes, stream.heads.base(), now));
}

void Gateway::note_root(const Packet& packet, const net::Message& bytes, TimePoint now) {
  ++frames_;
  bytes_ += bytes->size();
  if (last_packet_) interval_ = now - *last_packet_;
  last_packet_ = now;
  is_silent_ = false;
  for (const SourceInfo& source : packet.sources)
    if (index_of(source.sensor) < scene_->sensors.size())
      sensors_.seen(index_of(source.sensor), source.captured_at, now);
}

/// Whoever a stream serves starts afresh.
void Gateway::greet(const Stream& stream) {
  for (const auto& [viewer, session] : sessions_.admitted())
    if (&streams_[choice_.served_by(viewer)] == &stream)
      session->transport->send_text(viewer, hello());
}

/// Whoever is served by another stream starts afresh there, as a newcomer.
void Gateway::move_viewers(TimePoint now) {
  choice_.update(now);
  const auto moves = choice_.moves();
  for (std::size_t i = 0; i < streams_.size(); ++i)
    streams_[i].viewers.expect(
        std::ranges::any_of(moves, [&](const auto& move) { return move.second == i; }));
  for (const auto& [viewer, rung] : moves) {
    Stream& from = streams_[choice_.served_by(viewer)];
    if (!can_take(streams_[rung], from, now)) continue;
    from.viewers.move(viewer, streams_[rung].viewers);
    choice_.moved(viewer, rung, now);
    send_text(viewer, hello());
  }
}

/// A rung begins with an empty room: whoever comes from another waits until it is about as full.
bool Gateway::can_take(const Stream& stream, const Stream& before, TimePoint now) const {
  constexpr double kAsFull = 0.9;
  constexpr Duration kPatience = std::chrono::seconds(15);
  if (!stream.begun || !stream.viewers.can_start()) return false;
  return now - *stream.begun > kPatience ||
         static_cast<double>(stream.viewers.still_chunks()) >=
             kAsFull * static_cast<double>(before.viewers.still_chunks());
}

void Gateway::on_event(const Event& event, TimePoint now) {
  switch (event.kind) {
    case Event::Kind::opened:
      return on_decision(event.viewer,
                         sessions_.open(event.viewer, *event.transport, event.visitor, now), now);
    case Event::Kind::closed:
      return close(event.viewer);
    case Event::Kind::written:
      return send(viewers_of(event.viewer).written(event.viewer, event.messages, now));
    case Event::Kind::binary:
      return on_request(event.viewer, event.bytes, now);
    case Event::Kind::text:
      return on_text(event.viewer,
                     {reinterpret_cast<const char*>(event.bytes.data()), event.bytes.size()}, now);
  }
}

void Gateway::on_decision(net::ViewerId viewer, const ViewerSessions::Decision& decision,
                          TimePoint now) {
  switch (decision.verdict) {
    case ViewerSessions::Verdict::refused:
      return refuse(viewer, decision.why);
    case ViewerSessions::Verdict::must_show_token:
      return send_text(viewer, Json{{"type", "locked"}}.dump());
    case ViewerSessions::Verdict::admitted:
      choice_.opened(viewer, now);
      viewers_of(viewer).opened(viewer);
      return send_text(viewer, hello());
  }
}

/// Closes the connection; the viewer and the log get the same reason.
void Gateway::refuse(net::ViewerId viewer, const std::string& why) {
  const ViewerSessions::Session* const session = sessions_.find(viewer);
  if (!session) return;
  drops_.count("viewer → gateway",
               {Error::Cause::invalid, "from " + session->address + ": " + why});
  session->transport->close(viewer, why);
  close(viewer);
}

void Gateway::close(net::ViewerId viewer) {
  viewers_of(viewer).closed(viewer);
  choice_.closed(viewer);
  sessions_.close(viewer);
}

void Gateway::on_request(net::ViewerId viewer, std::span<const std::byte> bytes, TimePoint now) {
  const ViewerSessions::Session* const session = sessions_.find(viewer);
  if (!session) return;
  if (!session->is_admitted) return refuse(viewer, "no token");
  const auto request = codec::decode_control(bytes);
  if (!request && request.error().cause == Error::Cause::unsupported) {
    const bool is_news = is_due(version_refused_, kLogEvery, now);
    if (is_news) version_refused_ = now;
    drops_.count("viewer → gateway", request.error(), is_news);
    return send_text(viewer, Json{{"type", "error"}, {"message", request.error().message}}.dump());
  }
  if (!request) return refuse(viewer, "not a request");
  if (request->plan) return refuse(viewer, "a viewer makes no plans");
  if (const auto answer = viewers_of(viewer).asked(viewer, *request, now))
    session->transport->send(viewer, *answer);
}

void Gateway::on_text(net::ViewerId viewer, const std::string& text, TimePoint now) {
  ViewerSessions::Session* const session = sessions_.find(viewer);
  if (!session) return;
  const Json message =
      text.size() > kMaxText ? Json() : Json::parse(text, nullptr, /*allow_exceptions=*/false);
  const auto word = [&](const char* key) {
    return message.is_object() && message.contains(key) && message[key].is_string()
               ? message[key].get<std::string>()
               : "";
  };
  const auto integer = [&](const char* key) {
    return message.contains(key) && message[key].is_number_unsigned()
               ? std::optional(message[key].get<std::uint64_t>())
               : std::nullopt;
  };
  const std::string type = word("type");
  if (!session->is_admitted)
    return type == "token"
               ? on_decision(viewer, sessions_.show_token(viewer, word("token"), now), now)
               : refuse(viewer, "no token");
  if (type == "shown" && integer("sequence")) {
    Viewers& viewers = viewers_of(viewer);
    send(viewers.shown(viewer, *integer("sequence"), now));
    if (viewers.has_shown(viewer) && !std::exchange(session->is_kept, true))
      session->transport->pin(viewer);
    return;
  }
  if (type == "ping" && integer("id")) {
    const double ms = static_cast<double>(now.time_since_epoch().count()) / 1e6;
    return send_text(viewer,
                     Json{{"type", "pong"}, {"id", *integer("id")}, {"server_ms", ms}}.dump());
  }
  if (type == "target") return on_target(viewer, message.value("mbps", Json()));
  if (type == "token") return;  // a second token changes nothing
  refuse(viewer, "not a message of this protocol");
}

/// The rate that a viewer wants. What is none changes nothing.
void Gateway::on_target(net::ViewerId viewer, const Json& wanted) {
  const double mbps = wanted.is_number() ? wanted.get<double>() : 0;
  if (choice_.want(viewer, mbps)) return;
  send_text(viewer,
            Json{{"type", "error"}, {"message", "a target must be a number above 0"}}.dump());
}

/// Refuses viewers that occupy a connection without making progress.
void Gateway::close_overdue(TimePoint now) {
  for (Stream& stream : streams_)
    for (const auto& [viewer, why, reads] : stream.viewers.overdue(now)) {
      const ViewerSessions::Session* const session = sessions_.find(viewer);
      net::ViewerTransport* const transport = session ? session->transport : nullptr;
      refuse(viewer, why);
      if (!reads && transport) transport->cut(viewer);
    }
  for (const auto& [viewer, why] : sessions_.overdue(now)) refuse(viewer, why);
}

/// Logs once a second how many connections the transports refused or cut off, by cause.
void Gateway::log_refusals(TimePoint now) {
  if (!is_due(refusals_logged_, kLogEvery, now)) return;
  refusals_logged_ = now;
  auto all = transport_drops();
  for (const auto& [cause, times] : all)
    if (const auto more = times - refusals_[cause]; more > 0)
      log_.warn(cause + " (" + std::to_string(more) + ")");
  refusals_ = std::move(all);
}

/// Returns free heap memory to the system once the backlog of slow viewers has shrunk: the
/// allocator would keep it.
void Gateway::give_memory_back(TimePoint now) {
  constexpr std::size_t kWorthIt = 8u << 20;
  constexpr Duration kLater = std::chrono::seconds(1);  // by then sockets have released it, too
  const std::size_t unread = unread_bytes();
  most_unread_ = std::max(most_unread_, unread);
  if (most_unread_ >= kWorthIt && unread <= most_unread_ / 2) {
    most_unread_ = unread;
    give_back_at_ = now + kLater;
  }
  if (!give_back_at_ || now < *give_back_at_) return;
  give_back_at_.reset();
  ::malloc_trim(0);
}

std::size_t Gateway::unread_bytes() const {
  std::size_t bytes = 0;
  for (const Stream& stream : streams_) bytes += stream.viewers.unread_bytes();
  return bytes;
}

/// Requests to the root: for the chunks and key frames that viewers lack, for a complete packet
/// head, and the acknowledgement by which the root paces its output (back-pressure): the newest
/// packet that the fastest viewer has taken.
std::vector<node::Ask> Gateway::asks(TimePoint now) {
  std::vector<node::Ask> out;
  const bool is_controlled = scene_->rate.model != RateConfig::Model::fixed;
  if (is_controlled) ask_for_rates(now, out);
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    Stream& stream = streams_[i];
    if (!is_wanted(stream)) continue;
    if (auto request = stream.viewers.wanted(stream.heads.lacks_base(), now); !request.empty())
      out.push_back({i, std::move(request)});
  }
  const auto newest = streams_.front().viewers.newest();
  if (!newest || newest == acknowledged_ || !can_follow()) return out;
  acknowledged_ = newest;
  out.push_back({0, {.key_frames = {}, .chunks = {}, .taken = newest}});
  return out;
}

/// Whether any viewer can take another packet; true where nobody watches.
bool Gateway::can_follow() const {
  const auto nobody = [](const Stream& s) { return s.viewers.size() == 0; };
  return std::ranges::all_of(streams_, nobody) ||
         std::ranges::any_of(streams_, [](const Stream& s) { return s.viewers.can_take(); });
}

/// Tells the root what viewers want, at once and then again and again: messages may be lost, and a
/// rung that nobody wants any more ends. Who changes its mind quickly is not passed on each time.
void Gateway::ask_for_rates(TimePoint now, std::vector<node::Ask>& out) {
  constexpr Duration kSoonest = std::chrono::milliseconds(100);
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    Stream& stream = streams_[i];
    const std::optional<double> rate = choice_.rates()[i];
    if (!rate && stream.viewers.size() == 0) {
      if (stream.target_told) stream.viewers.begin_afresh();
      stream.target_told.reset(), stream.begun.reset();
      continue;
    }
    const double wanted = rate.value_or(stream.target_mbps);
    if (!is_due(stream.target_told, wanted == stream.target_mbps ? kTargetEvery : kSoonest, now))
      continue;
    stream.target_mbps = wanted, stream.target_told = now;
    codec::Control request;
    request.target_mbps = wanted;
    out.push_back({i, std::move(request)});
  }
}

void Gateway::watch_silence(TimePoint now) {
  constexpr Duration kStart = std::chrono::seconds(5);
  if (!last_packet_ && options_.expects_root && now - *first_step_ > kStart && !is_silent_) {
    is_silent_ = true;
    log_.warn("nothing has come from '" + streams_.front().node + "' yet");
  }
  if (is_silent_ || !last_packet_) return;
  if (now - *last_packet_ < std::clamp<Duration>(interval_ * 3, kSilence, kLongestSilence)) return;
  is_silent_ = true;
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(now - *last_packet_);
  Json stopped{{"type", "stopped"}, {"after_ms", ms.count()}};
  if (options_.has_ended()) stopped["ended"] = true;
  send_to_all(stopped.dump());
  log_.warn("nothing comes from '" + streams_.front().node + "'");
}

void Gateway::send(std::vector<Viewers::Send> messages) {
  for (auto& [viewer, message] : messages)
    if (const ViewerSessions::Session* const session = sessions_.find(viewer))
      session->transport->send(viewer, std::move(message));
}

void Gateway::send_text(net::ViewerId viewer, const std::string& text) {
  if (const ViewerSessions::Session* const session = sessions_.find(viewer))
    session->transport->send_text(viewer, text);
}

void Gateway::send_to_all(const std::string& text) {
  for (const auto& [viewer, session] : sessions_.admitted())
    session->transport->send_text(viewer, text);
}

std::map<std::string, std::uint64_t> Gateway::transport_drops() const {
  std::map<std::string, std::uint64_t> out;
  for (const net::ViewerTransport* transport : transports_)
    for (const auto& [cause, n] : transport->drops()) out[cause] += n;
  return out;
}

std::string Gateway::hello() const {
  const Scene& scene = *scene_;
  Json hello{
      {"type", "hello"},
      {"scene", scene.id},
      {"up", json_of(scene.up)},
      {"fps", scene.fps},
      {"lattice",
       {{"low_corner", json_of(scene.lattice.low_corner())}, {"step", scene.lattice.step_m()}}},
      {"sensors", sensor_names(scene)}};
  if (scene.rate.model != RateConfig::Model::fixed)
    hello["rate"] = {{"target_mbps", scene.rate.target_mbps}};
  if (scene.gateway && scene.gateway->start)
    hello["start"] = {{"eye", json_of(scene.gateway->start->eye)},
                      {"look_at", json_of(scene.gateway->start->look_at)}};
  return hello.dump();
}

node::NodeStats Gateway::stats(TimePoint now) const {
  node::NodeStats out{.id = id_, .frames = frames_, .drops = drops_.by_cause(), .stages_ms = {}};
  out.bytes = bytes_;
  const std::lock_guard lock(mutex_);
  const auto add = [&](const std::map<std::string, std::uint64_t>& more) {
    for (const auto& [cause, n] : more) out.drops[cause] += n;
  };
  std::size_t watching = 0;
  for (const Stream& stream : streams_)
    add(stream.viewers.drops()), watching += stream.viewers.size();
  add(transport_drops());
  out.is_silent = is_silent_ || !last_packet_;
  for (std::size_t i = 0; i < scene_->sensors.size(); ++i)
    out.inputs[scene_->sensors[i].id] = !out.is_silent && !sensors_.is_missing(i, now);
  out.viewers = {watching, 0, unread_bytes()};
  for (const net::ViewerTransport* transport : transports_)
    out.viewers->sent_bytes += transport->sent_bytes();
  return out;
}

}  // namespace mr::gateway
