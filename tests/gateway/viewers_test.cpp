#include "mr/gateway/viewers.h"

#include <gtest/gtest.h>

#include "mr/codec/head.h"
#include "mr/codec/packet_codec.h"
#include "mr/codec/receiver.h"
#include "mr/gateway/viewer_inbox.h"
#include "support/sender.h"

namespace mr {
namespace {

using gateway::ViewerInbox;
using gateway::Viewers;
using test::Sender;

constexpr TimePoint kStart{};

/// Their sockets take everything at once.
std::vector<Viewers::Send> read_all(Viewers& viewers, std::vector<Viewers::Send> sent) {
  for (std::size_t i = 0; i < sent.size(); ++i) {
    const auto more = viewers.written(sent[i].first, 1, kStart);
    sent.insert(sent.end(), more.begin(), more.end());
  }
  return sent;
}

std::vector<Viewers::Send> give_unread(Viewers& viewers, const Packet& packet,
                                       TimePoint now = kStart) {
  return viewers.packet(packet, net::as_message(codec::encode_packet(packet)),
                        codec::base_of(packet), now);
}
std::vector<Viewers::Send> give(Viewers& viewers, const Packet& packet) {
  return read_all(viewers, give_unread(viewers, packet));
}
std::vector<Viewers::Send> shown(Viewers& viewers, Viewers::Id id, std::uint64_t sequence) {
  return read_all(viewers, viewers.shown(id, sequence, kStart));
}

Packet decoded(const Viewers::Send& send) { return *codec::decode_packet(*send.second); }

TEST(Viewers, WhoMovesToAnotherStreamStartsThereWithEverything) {
  Sender sender, other;
  Viewers viewers, slower;
  viewers.opened(1);
  ASSERT_EQ(give(viewers, sender.next(true)).size(), 1u);
  EXPECT_FALSE(slower.can_start());
  slower.expect(true);
  EXPECT_TRUE(give(slower, other.next(true)).empty()) << "nobody is there yet";
  EXPECT_TRUE(slower.can_start());
  EXPECT_TRUE(slower.wanted(false, kStart).key_frames.empty()) << "it has one";
  viewers.move(1, slower);
  EXPECT_EQ(viewers.size(), 0u);
  EXPECT_TRUE(give(viewers, sender.next()).empty());
  const auto sent = give(slower, other.next());
  ASSERT_EQ(sent.size(), 1u);
  const Packet start = decoded(sent.front());
  EXPECT_EQ(start.chunks.size(), start.manifest.size());
  EXPECT_TRUE(start.textures.front().key_frame);
  viewers.move(7, slower);  // who has left
  EXPECT_EQ(slower.size(), 1u);
}

TEST(Viewers, ANewcomerStartsWithEverything) {
  Sender sender;
  Viewers viewers;
  sender.next(true);
  EXPECT_TRUE(give(viewers, sender.next()).empty());
  viewers.take_chunks(*codec::decode_chunks(sender.answer(viewers.wanted(false, kStart))));
  viewers.opened(7);
  EXPECT_EQ(viewers.wanted(false, kStart).key_frames, std::vector{StreamId{4}});
  EXPECT_TRUE(viewers.wanted(false, kStart).key_frames.empty()) << "asked a moment ago";
  EXPECT_TRUE(give(viewers, sender.next()).empty()) << "not without a key frame";
  sender.change(3);
  const auto sent = give(viewers, sender.next(true));
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].first, 7u);
  const Packet packet = decoded(sent[0]);
  EXPECT_EQ(packet.chunks.size(), packet.manifest.size());
  codec::Receiver receiver({});
  EXPECT_TRUE(receiver.accept(packet).empty());
  EXPECT_TRUE(receiver.scene());
}

TEST(Viewers, ANewcomerBetweenKeyFramesIsServedAtOnce) {
  Sender sender;
  Viewers viewers;
  for (int i = 0; i < 10; ++i) give(viewers, sender.next(i == 2));
  viewers.opened(7);
  EXPECT_TRUE(viewers.wanted(false, kStart).empty()) << "nothing is lacking";
  const Packet newest = sender.next();
  const auto sent = give(viewers, newest);
  ASSERT_EQ(sent.size(), 1u);
  const Packet packet = decoded(sent[0]);
  EXPECT_EQ(packet.textures.size(), 9u) << "the key frame and what followed";
  codec::Receiver receiver({});
  EXPECT_TRUE(receiver.accept(packet).empty());
  ASSERT_TRUE(receiver.scene());
  shown(viewers, 7, newest.sequence);
  for (int i = 0; i < 3; ++i)
    for (const auto& send : give(viewers, sender.next())) {
      EXPECT_TRUE(receiver.accept(decoded(send)).empty());
      EXPECT_TRUE(receiver.scene()) << "and goes on with what is sent to all";
      shown(viewers, 7, decoded(send).sequence);
    }
}

TEST(Viewers, APictureThatStaysForLongIsKept) {
  Sender sender;
  Viewers viewers;
  give(viewers, sender.next(true));
  give(viewers, sender.next());
  for (int i = 0; i < 1000; ++i) give(viewers, sender.quiet());
  viewers.opened(7);
  EXPECT_TRUE(viewers.wanted(false, kStart).empty());
  const auto sent = give(viewers, sender.quiet());
  ASSERT_EQ(sent.size(), 1u);
  codec::Receiver receiver({});
  EXPECT_TRUE(receiver.accept(decoded(sent[0])).empty());
  EXPECT_TRUE(receiver.scene());
}

TEST(Viewers, WhatIsKeptOfAStreamIsBounded) {
  Sender sender;
  Viewers viewers;
  give(viewers, sender.next(true));
  for (std::size_t i = 1; i < Viewers::kMaxKeptUnits; ++i) give(viewers, sender.next());
  viewers.opened(1);
  EXPECT_TRUE(viewers.wanted(false, kStart).empty());
  give(viewers, sender.next());
  EXPECT_EQ(viewers.wanted(false, kStart).key_frames, std::vector{StreamId{4}});
  EXPECT_EQ(give(viewers, sender.next(true)).size(), 1u);
}

TEST(Viewers, ALostUnitIsNotKeptOver) {
  Sender sender;
  Viewers viewers;
  give(viewers, sender.next(true));
  sender.next();  // lost, and nothing follows on the stream
  viewers.opened(1);
  EXPECT_TRUE(give(viewers, sender.quiet()).empty());
  EXPECT_EQ(viewers.wanted(false, kStart).key_frames, std::vector{StreamId{4}});
}

/// A packet of two streams: the sender's, and one that was coded once.
Packet with_plate(Packet packet, bool brings) {
  packet.views.push_back(packet.views[0]);
  packet.views[1].layer = Layer::still;
  packet.views[1].stream = StreamId{5};
  if (brings) {
    packet.textures.push_back(packet.textures.at(0));
    packet.textures.back().stream = StreamId{5}, packet.textures.back().serial = 17;
  }
  packet.streams.push_back({StreamId{5}, 17});
  return packet;
}

TEST(Viewers, AskForTheStreamThatIsLackingOnly) {
  Sender sender;
  Viewers viewers;
  give(viewers, with_plate(sender.next(true), true));
  for (std::size_t i = 0; i <= Viewers::kMaxKeptUnits; ++i)
    give(viewers, with_plate(sender.next(), false));
  viewers.opened(1);
  EXPECT_EQ(viewers.wanted(false, kStart).key_frames, std::vector{StreamId{4}});
  const auto sent = give(viewers, with_plate(sender.next(true), false));
  ASSERT_EQ(sent.size(), 1u);
  codec::Receiver receiver({});
  EXPECT_TRUE(receiver.accept(decoded(sent[0])).empty());
  EXPECT_TRUE(receiver.scene());
  viewers.asked(1, {{StreamId{5}, StreamId{6}}, {}, {}}, kStart);
  EXPECT_EQ(viewers.wanted(false, kStart).key_frames, std::vector{StreamId{5}}) << "6 is no view's";
}

/// As the gateway does it: the root's bytes are read here, and viewers get them as they are.
TEST(Viewers, DifferencesReachNewcomersAndSlowOnes) {
  Sender sender;
  Viewers viewers;
  codec::HeadWriter root;
  codec::HeadReader here;
  std::map<Viewers::Id, codec::HeadReader> heads;
  std::map<Viewers::Id, codec::Receiver> receivers;
  std::map<Viewers::Id, std::uint64_t> newest;
  const auto take = [&](const std::vector<Viewers::Send>& sent) {
    for (const auto& [id, message] : sent) {
      const auto packet = heads[id].read(*message);
      ASSERT_TRUE(packet) << packet.error().message;
      EXPECT_TRUE(receivers.try_emplace(id, Lattice{}).first->second.accept(*packet).empty());
      EXPECT_TRUE(receivers.at(id).scene());
      newest[id] = packet->sequence;
    }
  };
  std::uint64_t last = 0;
  for (int i = 0; i < 200; ++i) {
    if (i % 40 == 10) viewers.opened(static_cast<Viewers::Id>(i));
    if (i % 3 == 0) sender.change(i % 6);
    Packet packet = i % 5 == 0 ? sender.next(i == 0) : sender.quiet();
    last = packet.sequence;
    const auto bytes = net::as_message(root.write(packet));
    auto read = here.read(*bytes);
    ASSERT_TRUE(read);
    take(read_all(viewers, viewers.packet(*std::move(read), bytes, here.base(), kStart)));
    for (const auto& [id, sequence] : std::map(newest))
      if (id % 20 == 10 && i % 7 == 0) take(shown(viewers, id, sequence));
  }
  for (int i = 0; i < 3; ++i)
    for (const auto& [id, sequence] : std::map(newest)) take(shown(viewers, id, sequence));
  EXPECT_EQ(newest.size(), 5u);
  for (const auto& [id, sequence] : newest) EXPECT_EQ(sequence, last) << id;
}

TEST(Viewers, WhoLacksTheBaseStartsAnew) {
  Sender sender;
  Viewers viewers;
  viewers.opened(1);
  for (int i = 0; i < Viewers::kInFlight; ++i)
    EXPECT_EQ(give(viewers, sender.next(i == 0)).size(), 1u);
  EXPECT_TRUE(give(viewers, sender.next()).empty());
  viewers.asked(1, {{}, {}, {}, true}, kStart);
  viewers.asked(1, {{}, {}, {}, true}, kStart);
  const auto sent = give(viewers, sender.next());
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(decoded(sent[0]).chunks.size(), decoded(sent[0]).manifest.size());
  EXPECT_EQ(viewers.drops().size(), 1u);
}

TEST(Viewers, SlowOnesGetFoldedPacketsAndHoldUpNobody) {
  Sender sender;
  Viewers viewers;
  viewers.opened(1);
  viewers.opened(2);
  codec::Receiver slow({});
  std::uint64_t newest = 0;
  int to_fast = 0, to_slow = 0;
  const auto count = [&](const std::vector<Viewers::Send>& sent) {
    for (const auto& send : sent) {
      (send.first == 1 ? to_fast : to_slow)++;
      if (send.first == 2) {
        EXPECT_TRUE(slow.accept(decoded(send)).empty());
        EXPECT_TRUE(slow.streams_waiting().empty()) << "no gap";
      }
    }
  };
  for (int i = 0; i < 20; ++i) {
    if (i > 0) sender.change(i % 6);
    const Packet packet = sender.next(i == 0);
    newest = packet.sequence;
    count(give(viewers, packet));
    count(shown(viewers, 1, packet.sequence));
    EXPECT_TRUE(viewers.can_take()) << "the fast one sets the pace";
    EXPECT_EQ(viewers.newest(), newest);
  }
  EXPECT_EQ(to_fast, 20);
  EXPECT_EQ(to_slow, Viewers::kInFlight);
  count(shown(viewers, 2, newest - 19));
  EXPECT_EQ(to_slow, Viewers::kInFlight + 1);
  EXPECT_EQ(slow.newest_sequence(), newest);
  const auto scene = slow.scene();
  ASSERT_TRUE(scene);
  const auto expected = sender.chunks();
  for (std::size_t i = 0; i < expected.size(); ++i)
    EXPECT_EQ(scene->chunks[i]->key, expected[i].key);
  EXPECT_EQ(viewers.drops().size(), 1u);
}

TEST(Viewers, WhoFallsFarBehindStartsAnew) {
  Sender sender;
  Viewers viewers;
  viewers.opened(1);
  std::vector<Viewers::Send> sent;
  std::uint64_t first = 0;
  for (int i = 0; i < 80; ++i) {
    const Packet packet = sender.next(i % 10 == 0);
    if (i == 0) first = packet.sequence;
    const auto more = give(viewers, packet);
    sent.insert(sent.end(), more.begin(), more.end());
  }
  EXPECT_EQ(sent.size(), 2u) << "who shows nothing gets nothing";
  EXPECT_FALSE(viewers.can_take());
  EXPECT_TRUE(viewers.wanted(false, kStart).empty()) << "nobody could use it";
  shown(viewers, 1, first + 1);
  const auto again = give(viewers, sender.next());
  ASSERT_EQ(again.size(), 1u);
  const Packet packet = decoded(again[0]);
  EXPECT_EQ(packet.chunks.size(), packet.manifest.size());
}

TEST(Viewers, AsksTheRootForWhatItLacksItself) {
  Sender sender;
  Viewers viewers;
  static_cast<void>(sender.next(true));
  const Packet packet = sender.next();  // the gateway came late
  give(viewers, packet);
  const codec::Control request = viewers.wanted(false, kStart);
  EXPECT_EQ(request.chunks, packet.manifest);
  EXPECT_TRUE(request.key_frames.empty()) << "nobody watches";
  viewers.take_chunks(*codec::decode_chunks(sender.answer(request)));
  viewers.opened(1);
  EXPECT_EQ(give(viewers, sender.next(true)).size(), 1u);
}

TEST(Viewers, GiveChunksOnRequest) {
  Sender sender;
  Viewers viewers;
  viewers.opened(1);
  const Packet packet = sender.next(true);
  give(viewers, packet);
  const auto answer =
      viewers.asked(1, {{StreamId{4}}, {packet.manifest[2], packet.manifest[0]}, {}}, kStart);
  ASSERT_TRUE(answer);
  const auto chunks = codec::decode_chunks(**answer);
  ASSERT_TRUE(chunks);
  ASSERT_EQ(chunks->size(), 2u);
  EXPECT_EQ((*chunks)[0].key, packet.manifest[0]);
  EXPECT_EQ(viewers.wanted(false, kStart).key_frames, std::vector{StreamId{4}});
  EXPECT_FALSE(viewers.asked(9, {}, kStart));
  const TimePoint later = kStart + Viewers::kAnswerEvery;
  EXPECT_FALSE(viewers.asked(1, {{}, {{{{9, 9, 9}, SensorId{0}}, 0, 0}}, {}}, later))
      << "unknown chunks";
}

TEST(ViewerInbox, AFloodTakesNothingFromOthers) {
  using Kind = ViewerInbox::Event::Kind;
  const std::vector<std::byte> word(10);
  ViewerInbox inbox;
  std::size_t taken = 0;
  for (int i = 0; i < 10'000; ++i) taken += inbox.received(1, word, true, kStart);
  EXPECT_EQ(taken, ViewerInbox::kMostMessages);
  EXPECT_TRUE(inbox.received(2, word, true, kStart));
  inbox.closed(1);
  const auto events = inbox.take();
  ASSERT_EQ(events.size(), ViewerInbox::kMostMessages + 2);
  EXPECT_EQ(events[ViewerInbox::kMostMessages].viewer, 2u);
  EXPECT_EQ(events.back().kind, Kind::closed);
  EXPECT_FALSE(
      inbox.received(3, std::vector<std::byte>(ViewerInbox::kMostBytes + 1), false, kStart));
}

TEST(ViewerInbox, ASteadyFloodIsOneToo) {
  ViewerInbox inbox;
  const std::vector<std::byte> word(10);
  TimePoint now = kStart;
  const auto lasts = [&](net::ViewerId viewer, int per_second) {
    int i = 0;
    for (; i < 100 * per_second; ++i) {
      now += std::chrono::microseconds(1'000'000 / per_second);
      if (!inbox.received(viewer, word, true, now)) break;
      inbox.take();
    }
    return i / per_second;
  };
  EXPECT_EQ(lasts(1, 100), 100) << "a busy page sends less than that";
  EXPECT_LT(lasts(2, 1000), 2);
}

/// A packet with all chunks, one of which is large.
Packet large_packet(Sender& sender, std::size_t bytes) {
  Packet packet = sender.next(true);
  packet.chunks.clear();
  for (const ChunkKey& key : packet.manifest)
    packet.chunks.push_back({key, 0, 1, {}, {}, {std::byte{1}}});
  packet.chunks[0].payload = std::vector<std::byte>(bytes);
  return packet;
}

TEST(Viewers, WordsDoNotMakeRoomForMore) {
  Sender sender;
  Viewers viewers;
  viewers.opened(1);
  std::size_t sent = 0;
  for (int i = 0; i < 20; ++i) {
    const Packet packet = sender.next(i == 0);
    sent += give_unread(viewers, packet).size();
    sent += viewers.shown(1, packet.sequence, kStart).size();  // it never read it
  }
  EXPECT_EQ(sent, static_cast<std::size_t>(Viewers::kInFlight));
  viewers.asked(1, {{}, {}, {}, true}, kStart);
  EXPECT_TRUE(give_unread(viewers, sender.next(true)).empty()) << "everything anew, unread";
  viewers.written(1, 2, kStart);
  EXPECT_EQ(give_unread(viewers, sender.next(true)).size(), 1u);
}

TEST(Viewers, OneAnswerAtATimeIsUnread) {
  Sender sender;
  Viewers viewers;
  viewers.opened(1);
  const Packet packet = sender.next(true);
  give(viewers, packet);
  const codec::Control all{{}, packet.manifest, {}};
  TimePoint now = kStart;
  EXPECT_TRUE(viewers.asked(1, all, now));
  for (int i = 0; i < 50; ++i) EXPECT_FALSE(viewers.asked(1, all, now += Viewers::kAnswerEvery));
  viewers.written(1, 1, now);
  EXPECT_TRUE(viewers.asked(1, all, now += Viewers::kAnswerEvery));
  EXPECT_EQ(viewers.drops().count("viewers: requests before the last answer was read"), 1u);
}

TEST(Viewers, WhatAllHaveNotReadIsBounded) {
  constexpr std::size_t kLarge = 6u << 20;
  Sender sender;
  Viewers viewers;
  TimePoint now = kStart;
  Viewers::Id last = 0;
  std::size_t closed = 0, most = 0;
  for (int i = 0; i < 60; ++i) {
    viewers.opened(++last);
    give_unread(viewers, large_packet(sender, kLarge), now);
    now += std::chrono::seconds(1);
    for (const auto& late : viewers.overdue(now)) viewers.closed(late.viewer), ++closed;
    most = std::max(most, viewers.unread_bytes());
  }
  EXPECT_GT(closed, 0u);
  EXPECT_LT(most, Viewers::kUnreadBytes + 2 * kLarge);
  while (last > 0) viewers.closed(last--);
  EXPECT_EQ(viewers.unread_bytes(), 0u);
}

TEST(Viewers, WhatAllAreSentCountsOnce) {
  Sender sender;
  Viewers viewers;
  for (Viewers::Id id = 0; id < 60; ++id) viewers.opened(id);
  const auto sent = give_unread(viewers, large_packet(sender, 1u << 20));
  ASSERT_EQ(sent.size(), 60u);
  EXPECT_EQ(viewers.unread_bytes(), sent[0].second->size());
}

TEST(Viewers, WhoNeverShowsAnythingIsClosed) {
  Sender sender;
  Viewers viewers;
  viewers.opened(1);
  viewers.opened(2);
  const Packet packet = sender.next(true);
  give(viewers, packet);
  shown(viewers, 2, packet.sequence);
  EXPECT_TRUE(viewers.overdue(kStart + Viewers::kFirstShown).empty());
  const auto overdue = viewers.overdue(kStart + Viewers::kFirstShown + Duration(1));
  ASSERT_EQ(overdue.size(), 1u);
  EXPECT_EQ(overdue[0].viewer, 1u);
  EXPECT_TRUE(overdue[0].reads);
}

/// A viewer that is left alone from kStart on is overdue after kSlowest, and not before.
void expect_overdue_after_a_minute(const Viewers& viewers) {
  EXPECT_TRUE(viewers.overdue(kStart + Viewers::kSlowest).empty());
  EXPECT_EQ(viewers.overdue(kStart + Viewers::kSlowest + Duration(1)).size(), 1u);
}

TEST(Viewers, WhoStopsToShowIsClosedAfterAMinute) {
  Sender sender;
  Viewers viewers;
  viewers.opened(1);
  const Packet first = sender.next(true);
  give(viewers, first);
  shown(viewers, 1, first.sequence);
  for (int i = 0; i < 3; ++i) give(viewers, sender.next());
  expect_overdue_after_a_minute(viewers);
}

TEST(Viewers, WhoReadsForAMinuteIsClosed) {
  Sender sender;
  Viewers viewers;
  viewers.opened(1);
  give_unread(viewers, sender.next(true));
  expect_overdue_after_a_minute(viewers);
}

TEST(Viewers, AllStartAnewWhereTheRootDoes) {
  Sender sender;
  Viewers viewers;
  viewers.opened(1);
  give(viewers, sender.next(true));
  viewers.begin_afresh();
  Sender another(6, 2);
  const auto sent = give(viewers, another.next(true));
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(decoded(sent[0]).chunks.size(), decoded(sent[0]).manifest.size());
}

TEST(Viewers, WhoAsksInALoopIsAnsweredNowAndThen) {
  Sender sender;
  Viewers viewers;
  viewers.opened(1);
  viewers.opened(2);
  const Packet packet = sender.next(true);
  give(viewers, packet);
  const codec::Control all{{}, packet.manifest, {}};
  EXPECT_TRUE(viewers.asked(1, all, kStart));
  viewers.written(1, 1, kStart);
  EXPECT_FALSE(viewers.asked(1, all, kStart + std::chrono::milliseconds(1)));
  EXPECT_TRUE(viewers.asked(2, all, kStart + std::chrono::milliseconds(1)));
  EXPECT_TRUE(viewers.asked(1, all, kStart + Viewers::kAnswerEvery));
  EXPECT_EQ(viewers.drops().size(), 1u);
}

}  // namespace
}  // namespace mr
