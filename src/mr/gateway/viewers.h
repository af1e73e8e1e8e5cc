#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "mr/codec/control_pacing.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/net/outbox.h"

namespace mr::gateway {

/// What the gateway knows of its viewers, and decides to send them (docs/wire-format.md,
/// WebSocket): a newcomer starts with the base of the root's packets, every chunk, and of every
/// stream the newest key frame and what followed it, all of which is kept here; at most `kInFlight`
/// packets are on their way to a viewer, what comes meanwhile is folded; a viewer that falls far
/// behind starts anew. What viewers are sent and have not read is bounded, for each and for all
/// together: acknowledgements are words, only what a socket took was read. No socket, thread or
/// clock inside.
class Viewers {
 public:
  using Id = std::uint64_t;
  using Send = std::pair<Id, net::Message>;

  static constexpr int kInFlight = 2;
  static constexpr std::size_t kMaxWaiting = 30;  ///< packets; a viewer with more starts anew
  /// Of a stream that has more than this since its key frame nothing is kept; newcomers then wait
  /// for another one.
  static constexpr std::size_t kMaxKeptUnits = 60, kMaxKeptBytes = 4u << 20;
  static constexpr Duration kAnewEvery = std::chrono::milliseconds(500);    ///< per viewer
  static constexpr Duration kAnswerEvery = std::chrono::milliseconds(100);  ///< per viewer
  static constexpr std::size_t kAnswerBytes = 4u << 20;   ///< payload of one answer, at most
  static constexpr std::size_t kUnreadBytes = 64u << 20;  ///< of all viewers of a stream together
  /// A viewer that shows nothing for so long after it got something is none; one that did before,
  /// and then does not for kSlowest.
  static constexpr Duration kFirstShown = std::chrono::seconds(10);
  /// Unread for so long, a message is given up with its viewer; where all viewers' are too many,
  /// after the shorter time.
  static constexpr Duration kSlowest = std::chrono::seconds(60), kSlow = std::chrono::seconds(2);

  void opened(Id viewer);
  void closed(Id viewer);

  /// Takes a packet of the root, as its bytes tell it by its difference to `base`. Returns what to
  /// send now.
  std::vector<Send> packet(Packet packet, net::Message bytes, std::shared_ptr<const Packet> base,
                           TimePoint now);
  /// Nothing that came from the root before holds.
  void begin_afresh();
  /// Takes the root's answer to a request for chunks.
  void take_chunks(std::vector<EncodedChunk> chunks);
  /// The viewer has shown, or given up, the packet with this sequence.
  std::vector<Send> shown(Id viewer, std::uint64_t sequence, TimePoint now);
  /// The viewer's socket took so many of the messages that it was sent.
  std::vector<Send> written(Id viewer, std::size_t messages, TimePoint now);
  struct Overdue {
    Id viewer;
    std::string why;
    bool reads;  ///< else it would not read why
  };
  /// Whom to close.
  std::vector<Overdue> overdue(TimePoint now) const;
  /// A viewer's request: the answer, if there is one. Whoever asks again too soon gets none. Who
  /// lacks the base starts anew with the next packet.
  std::optional<net::Message> asked(Id viewer, const codec::Control& request, TimePoint now);

  /// Whether a newcomer could start now, and with how many chunks of still surface.
  bool can_start() const { return complete() && streams_without_start().empty(); }
  std::size_t still_chunks() const;
  /// Somebody will come, who cannot yet be served.
  void expect(bool newcomers) { expects_newcomers_ = newcomers; }
  /// A viewer is served from another stream: there it starts anew.
  void move(Id viewer, Viewers& to);

  /// What to ask the root for now: chunks that are missing, key frames that somebody waits for, and
  /// a whole head where its base is lacking.
  codec::Control wanted(bool lacks_base, TimePoint now);

  /// Of the newest packet; nothing before the first.
  std::optional<std::uint64_t> newest() const {
    return newest_ ? std::optional(newest_->sequence) : std::nullopt;
  }
  /// Whether somebody can take another packet.
  bool can_take() const;

  std::size_t size() const { return viewers_.size(); }
  /// Whether the viewer ever showed something.
  bool has_shown(Id viewer) const;
  /// What was sent and not read; what several are sent counts once.
  std::size_t unread_bytes() const;
  /// Packets that were folded, and viewers that had to start anew.
  std::map<std::string, std::uint64_t> drops() const;

 private:
  struct Waiting {
    std::shared_ptr<const Packet> packet;
    net::Message bytes;
  };
  struct Unread {
    net::Message message;
    TimePoint at;
    bool is_answer = false;
  };
  struct Viewer {
    bool fresh = true;       // waits for everything
    bool has_shown = false;  // anything, ever
    std::deque<std::uint64_t> in_flight;
    std::vector<Waiting> waiting;
    std::deque<Unread> unread;
    std::optional<TimePoint> answered, began_anew, first_written, last_shown;

    bool may_get_packet() const;
    bool has_unread_answer() const;
  };
  /// A stream's newest key frame and all units after it; nothing where some were lost, or are too
  /// many.
  struct Kept {
    std::vector<TextureUnit> units;
    std::size_t bytes = 0;
  };

  void take_head(const std::shared_ptr<const Packet>& packet);
  void keep_units(const Packet& packet);
  std::set<StreamId> streams_without_start() const;
  bool complete() const;
  net::Message refresh(const Packet& packet) const;
  std::size_t refresh_bytes() const;
  std::set<StreamId> key_frames_lacking() const;
  std::optional<Send> flush(Id id, Viewer& viewer, TimePoint now);
  std::vector<EncodedChunk> find_chunks(const std::vector<ChunkKey>& keys) const;

  std::map<Id, Viewer> viewers_;
  std::shared_ptr<const Packet> newest_, base_;
  std::map<ChunkKey, EncodedChunk> chunks_;  // of the newest manifest
  std::map<StreamId, Kept> kept_;            // by stream
  std::set<StreamId> key_frames_wanted_;     // by viewers
  bool expects_newcomers_ = false;
  codec::ControlPacing pacing_;
  std::uint64_t folded_ = 0, restarted_ = 0, impatient_ = 0, unread_answers_ = 0;
};

}  // namespace mr::gateway
