#include "mr/node/viewers.h"

#include <gtest/gtest.h>

#include "mr/codec/head.h"
#include "mr/codec/packet_codec.h"
#include "mr/codec/receiver.h"
#include "mr/node/viewer_inbox.h"
#include "support/sender.h"

namespace mr {
namespace {

using node::ViewerInbox;
using node::Viewers;
using test::Sender;

constexpr TimePoint kStart{};

std::vector<Viewers::Send> give(Viewers& viewers, const Packet& packet) {
  return viewers.packet(
      packet, std::make_shared<const std::vector<std::byte>>(codec::encode_packet(packet)),
      codec::base_of(packet));
}

Packet decoded(const Viewers::Send& send) { return *codec::decode_packet(*send.second); }

TEST(Viewers, ANewcomerStartsWithEverything) {
  Sender sender;
  Viewers viewers;
  sender.next(true);
  EXPECT_TRUE(give(viewers, sender.next()).empty());
  viewers.take_chunks(*codec::decode_chunks(sender.answer(viewers.wanted(kStart))));
  viewers.opened(7);
  EXPECT_EQ(viewers.wanted(kStart).key_frames, std::vector<std::uint32_t>{4});
  EXPECT_TRUE(viewers.wanted(kStart).key_frames.empty()) << "asked a moment ago";
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
  EXPECT_TRUE(viewers.wanted(kStart).empty()) << "nothing is lacking";
  const Packet newest = sender.next();
  const auto sent = give(viewers, newest);
  ASSERT_EQ(sent.size(), 1u);
  const Packet packet = decoded(sent[0]);
  EXPECT_EQ(packet.textures.size(), 9u) << "the key frame and what followed";
  codec::Receiver receiver({});
  EXPECT_TRUE(receiver.accept(packet).empty());
  ASSERT_TRUE(receiver.scene());
  viewers.shown(7, newest.sequence);
  for (int i = 0; i < 3; ++i)
    for (const auto& send : give(viewers, sender.next())) {
      EXPECT_TRUE(receiver.accept(decoded(send)).empty());
      EXPECT_TRUE(receiver.scene()) << "and goes on with what is sent to all";
      viewers.shown(7, decoded(send).sequence);
    }
}

TEST(Viewers, APictureThatStaysForLongIsKept) {
  Sender sender;
  Viewers viewers;
  give(viewers, sender.next(true));
  give(viewers, sender.next());
  for (int i = 0; i < 1000; ++i) give(viewers, sender.quiet());
  viewers.opened(7);
  EXPECT_TRUE(viewers.wanted(kStart).empty());
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
  EXPECT_TRUE(viewers.wanted(kStart).empty());
  give(viewers, sender.next());
  EXPECT_EQ(viewers.wanted(kStart).key_frames, std::vector<std::uint32_t>{4});
  EXPECT_EQ(give(viewers, sender.next(true)).size(), 1u);
}

TEST(Viewers, ALostUnitIsNotKeptOver) {
  Sender sender;
  Viewers viewers;
  give(viewers, sender.next(true));
  sender.next();  // lost, and nothing follows on the stream
  viewers.opened(1);
  EXPECT_TRUE(give(viewers, sender.quiet()).empty());
  EXPECT_EQ(viewers.wanted(kStart).key_frames, std::vector<std::uint32_t>{4});
}

/// A packet of two streams: the sender's, and one that was coded once.
Packet with_plate(Packet packet, bool brings) {
  packet.views.push_back(packet.views[0]);
  packet.views[1].layer = Layer::still;
  packet.views[1].stream = 5;
  if (brings) {
    packet.textures.push_back(packet.textures.at(0));
    packet.textures.back().stream = 5, packet.textures.back().serial = 17;
  }
  packet.streams.push_back({5, 17});
  return packet;
}

TEST(Viewers, AskForTheStreamThatIsLackingOnly) {
  Sender sender;
  Viewers viewers;
  give(viewers, with_plate(sender.next(true), true));
  for (std::size_t i = 0; i <= Viewers::kMaxKeptUnits; ++i)
    give(viewers, with_plate(sender.next(), false));
  viewers.opened(1);
  EXPECT_EQ(viewers.wanted(kStart).key_frames, std::vector<std::uint32_t>{4});
  const auto sent = give(viewers, with_plate(sender.next(true), false));
  ASSERT_EQ(sent.size(), 1u);
  codec::Receiver receiver({});
  EXPECT_TRUE(receiver.accept(decoded(sent[0])).empty());
  EXPECT_TRUE(receiver.scene());
  viewers.asked(1, {{5, 6}, {}, {}}, kStart);
  EXPECT_EQ(viewers.wanted(kStart).key_frames, std::vector<std::uint32_t>{5}) << "6 is no view's";
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
    const auto bytes = std::make_shared<const std::vector<std::byte>>(root.write(packet));
    auto read = here.read(*bytes);
    ASSERT_TRUE(read);
    take(viewers.packet(*std::move(read), bytes, here.base()));
    for (const auto& [id, sequence] : std::map(newest))
      if (id % 20 == 10 && i % 7 == 0) take(viewers.shown(id, sequence));
  }
  for (int i = 0; i < 3; ++i)
    for (const auto& [id, sequence] : std::map(newest)) take(viewers.shown(id, sequence));
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
    count(viewers.shown(1, packet.sequence));
    EXPECT_EQ(viewers.taken(), newest) << "the fast one sets the pace";
  }
  EXPECT_EQ(to_fast, 20);
  EXPECT_EQ(to_slow, Viewers::kInFlight);
  count(viewers.shown(2, newest - 19));
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
  EXPECT_EQ(viewers.taken(), std::nullopt);
  EXPECT_TRUE(viewers.wanted(kStart).empty()) << "nobody could use it";
  viewers.shown(1, first + 1);
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
  const codec::Request request = viewers.wanted(kStart);
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
  const auto answer = viewers.asked(1, {{4}, {packet.manifest[2], packet.manifest[0]}, {}}, kStart);
  ASSERT_TRUE(answer);
  const auto chunks = codec::decode_chunks(**answer);
  ASSERT_TRUE(chunks);
  ASSERT_EQ(chunks->size(), 2u);
  EXPECT_EQ((*chunks)[0].key, packet.manifest[0]);
  EXPECT_EQ(viewers.wanted(kStart).key_frames, std::vector<std::uint32_t>{4});
  EXPECT_FALSE(viewers.asked(9, {}, kStart));
  const TimePoint later = kStart + Viewers::kAnswerEvery;
  EXPECT_FALSE(viewers.asked(1, {{}, {{{{9, 9, 9}, 0}, 0, 0}}, {}}, later)) << "unknown chunks";
}

TEST(ViewerInbox, AFloodTakesNothingFromOthers) {
  using Kind = ViewerInbox::Event::Kind;
  ViewerInbox inbox;
  const std::vector<std::byte> word(10);
  const auto from = [&](net::ClientId viewer) {
    std::vector<Kind> kinds;
    for (const ViewerInbox::Event& event : inbox.take())
      if (event.viewer == viewer) kinds.push_back(event.kind);
    return kinds;
  };
  for (int round = 0; round < 2; ++round) {
    for (int i = 0; i < 10'000; ++i) inbox.add(Kind::text, 1, word);
    inbox.add(Kind::text, 2, word);
    EXPECT_EQ(from(2), std::vector{Kind::text});
  }
  for (int i = 0; i < 10'000; ++i) inbox.add(Kind::text, 1, word);
  inbox.add(Kind::closed, 1);
  std::vector<Kind> kinds = from(1);
  ASSERT_EQ(kinds.size(), ViewerInbox::kMostMessages + 2);
  EXPECT_EQ(kinds[ViewerInbox::kMostMessages], Kind::flood);
  EXPECT_EQ(kinds.back(), Kind::closed);

  inbox.add(Kind::binary, 1, std::vector<std::byte>(ViewerInbox::kMostBytes + 1));
  EXPECT_EQ(from(1), std::vector{Kind::flood});
}

TEST(Viewers, WhoAsksInALoopIsAnsweredNowAndThen) {
  Sender sender;
  Viewers viewers;
  viewers.opened(1);
  viewers.opened(2);
  const Packet packet = sender.next(true);
  give(viewers, packet);
  const codec::Request all{{}, packet.manifest, {}};
  EXPECT_TRUE(viewers.asked(1, all, kStart));
  EXPECT_FALSE(viewers.asked(1, all, kStart + std::chrono::milliseconds(1)));
  EXPECT_TRUE(viewers.asked(2, all, kStart + std::chrono::milliseconds(1)));
  EXPECT_TRUE(viewers.asked(1, all, kStart + Viewers::kAnswerEvery));
  EXPECT_EQ(viewers.drops().size(), 1u);
}

}  // namespace
}  // namespace mr
