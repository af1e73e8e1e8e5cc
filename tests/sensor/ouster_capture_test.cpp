#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>

#include "core/temp_dir.h"
#include "mr/sensor/ouster/ip_reassembly.h"
#include "mr/sensor/ouster/udp_capture.h"
#include "mr/sensor/ouster/udp_socket.h"
#include "support/ouster_packets.h"

namespace mr::sensor::ouster_capture_test {
namespace {

using test::append;
using test::Bytes;
using test::ethernet;
using test::ipv4_fragments;
using test::ipv4_packet;
using test::pcap_file;
using test::udp_packet;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// A payload that no other size or start makes.
Bytes payload_of(std::size_t size, int start = 0) {
  Bytes out(size);
  for (std::size_t i = 0; i < size; ++i)
    out[i] = static_cast<std::byte>((i * 7 + i / 256 + static_cast<std::size_t>(start)) % 251);
  return out;
}

struct Capture {
  std::vector<Bytes> payloads;
  std::vector<Datagram> datagrams;  ///< their payloads are gone
  std::string problem;
  PcapReader::Counts counts;
};

Capture read_capture(const Bytes& file) {
  Capture out;
  auto reader = PcapReader::open(file, "test.pcap");
  if (!reader) {
    out.problem = reader.error().message;
    return out;
  }
  for (;;) {
    auto datagram = reader->next();
    if (!datagram) {
      out.problem = datagram.error().message;
      const auto after = reader->next();
      EXPECT_TRUE(after.ok() && !*after) << "nothing comes after an error";
      break;
    }
    if (!*datagram) break;
    out.payloads.emplace_back((*datagram)->payload.begin(), (*datagram)->payload.end());
    out.datagrams.push_back(**datagram);
  }
  out.counts = reader->counts();
  return out;
}

TEST(OusterCapture, DatagramsHaveTimeAddressesAndPayload) {
  const Bytes payload = payload_of(2000);
  const Capture got = read_capture(pcap_file(
      {ethernet(ipv4_packet(udp_packet(payload))), ethernet(ipv4_packet(udp_packet({}, 7503)))}));
  EXPECT_EQ(got.problem, "");
  ASSERT_EQ(got.payloads.size(), 2u);
  EXPECT_EQ(got.payloads[0], payload);
  EXPECT_TRUE(got.payloads[1].empty());
  const Datagram& first = got.datagrams[0];
  EXPECT_EQ(to_string(first.from.address), "192.168.1.10");
  EXPECT_EQ(to_string(first.to.address), "192.168.1.2");
  EXPECT_EQ(first.from.port, 40000);
  EXPECT_EQ(first.to.port, 7502);
  EXPECT_EQ(first.captured_at, TimePoint(std::chrono::seconds(100)));
  EXPECT_EQ(got.datagrams[1].captured_at, TimePoint(std::chrono::milliseconds(100100)));
}

TEST(OusterCapture, ReadsEveryKindOfLink) {
  const Bytes payload = payload_of(100), packet = ipv4_packet(udp_packet(payload));
  const auto behind = [&](std::size_t header, std::size_t type_at) {
    Bytes out(header);
    if (type_at < header) out[type_at] = std::byte{0x08};
    append(out, packet);
    return out;
  };
  constexpr std::size_t kNoType = 99;
  const std::pair<Bytes, std::uint32_t> frames[] = {
      {ethernet(packet), 1}, {ethernet(packet, 1), 1}, {ethernet(packet, 2), 1},
      {behind(16, 14), 113}, {behind(20, 0), 276},     {packet, 101},
      {packet, 228},         {behind(4, kNoType), 0},  {behind(4, kNoType), 108}};
  for (const auto& [frame, link] : frames) {
    const Capture got = read_capture(pcap_file({frame}, link));
    ASSERT_EQ(got.payloads.size(), 1u) << "link " << link << " " << got.problem;
    EXPECT_EQ(got.payloads[0], payload) << link;
  }
  EXPECT_THAT(read_capture(pcap_file({packet}, 105)).problem,
              AllOf(HasSubstr("test.pcap: link type"), HasSubstr("supported are Ethernet"),
                    Not(HasSubstr("\n"))));
}

TEST(OusterCapture, ReadsUnfragmentedIpv6) {
  const Bytes payload = payload_of(500), udp = udp_packet(payload);
  Bytes packet(40);
  packet[0] = std::byte{0x60};
  packet[4] = static_cast<std::byte>(udp.size() >> 8);
  packet[5] = static_cast<std::byte>(udp.size());
  packet[6] = std::byte{17};
  packet[8] = std::byte{0xFE}, packet[9] = std::byte{0x80}, packet[23] = std::byte{9};
  append(packet, udp);
  const Capture got = read_capture(pcap_file({ethernet(packet, 0, 0x86DD)}));
  ASSERT_EQ(got.payloads.size(), 1u);
  EXPECT_EQ(got.payloads[0], payload);
  EXPECT_EQ(to_string(got.datagrams[0].from.address), "fe80::9");
}

TEST(OusterCapture, OtherTrafficIsPassedOver) {
  Bytes tcp = ipv4_packet(udp_packet(payload_of(10)));
  tcp[9] = std::byte{6};
  Bytes too_long = ipv4_packet(udp_packet(payload_of(10)));
  too_long[2] = std::byte{0xFF};
  Bytes long_udp = ipv4_packet(udp_packet(payload_of(10)));
  long_udp[24] = std::byte{1};
  const Capture got = read_capture(
      pcap_file({ethernet(tcp), ethernet(Bytes(28), 0, 0x0806), Bytes(3), ethernet({}),
                 ethernet(too_long), ethernet(long_udp), ethernet(Bytes(5, std::byte{0x45})),
                 ethernet(ipv4_packet(udp_packet(payload_of(10))))}));
  EXPECT_EQ(got.problem, "");
  EXPECT_EQ(got.payloads.size(), 1u);
  EXPECT_EQ(got.counts.datagrams, 1u);
  EXPECT_EQ(got.counts.other, 4u);
  EXPECT_EQ(got.counts.damaged, 3u);
}

/// Fragments in order, backwards, mixed, and twice.
TEST(OusterCapture, FragmentsComeTogetherInAnyOrder) {
  const Bytes payload = payload_of(8448);
  const auto fragments = ipv4_fragments(udp_packet(payload), 1480, 77);
  ASSERT_EQ(fragments.size(), 6u);
  const std::vector<std::vector<int>> orders{
      {0, 1, 2, 3, 4, 5}, {5, 4, 3, 2, 1, 0}, {3, 0, 5, 1, 4, 2}, {2, 2, 0, 5, 0, 3, 1, 5, 4}};
  for (const auto& order : orders) {
    std::vector<Bytes> frames;
    for (const int i : order) frames.push_back(ethernet(fragments[static_cast<std::size_t>(i)]));
    const Capture got = read_capture(pcap_file(frames));
    ASSERT_EQ(got.payloads.size(), 1u);
    EXPECT_EQ(got.payloads[0], payload);
    EXPECT_EQ(got.datagrams[0].to.port, 7502);
  }
}

TEST(OusterCapture, ALostFragmentLosesItsDatagramOnly) {
  const Bytes first = payload_of(4000), second = payload_of(4000, 1);
  const auto a = ipv4_fragments(udp_packet(first), 1480, 1);
  const auto b = ipv4_fragments(udp_packet(second), 1480, 2);
  ASSERT_EQ(a.size(), 3u);
  for (std::size_t lost = 0; lost < 3; ++lost) {
    std::vector<Bytes> frames;
    for (std::size_t i = 0; i < 3; ++i) {  // interleaved
      if (i != lost) frames.push_back(ethernet(a[i]));
      frames.push_back(ethernet(b[i]));
    }
    const Capture got = read_capture(pcap_file(frames));
    ASSERT_EQ(got.payloads.size(), 1u);
    EXPECT_EQ(got.payloads[0], second);
    EXPECT_EQ(got.counts.incomplete, 1u);
  }
}

TEST(OusterCapture, SendersWithTheSameIdsAreNotMixed) {
  const Bytes first = payload_of(2000), second = payload_of(2000, 1);
  const auto a = ipv4_fragments(udp_packet(first), 1480, 7, 10);
  const auto b = ipv4_fragments(udp_packet(second), 1480, 7, 11);
  const Capture got =
      read_capture(pcap_file({ethernet(a[0]), ethernet(b[1]), ethernet(b[0]), ethernet(a[1])}));
  ASSERT_EQ(got.payloads.size(), 2u);
  EXPECT_EQ(got.payloads[0], second);
  EXPECT_EQ(got.payloads[1], first);
}

IpFragment fragment_of(std::span<const std::byte> bytes, std::size_t offset, bool more,
                       std::uint16_t id = 1) {
  return {.from = {},
          .to = {},
          .id = id,
          .protocol = 17,
          .offset = offset,
          .more = more,
          .bytes = bytes};
}

TEST(OusterReassembly, OverlapsKeepWhatCameFirst) {
  IpReassembly reassembly;
  const Bytes ones(16, std::byte{1}), twos(24, std::byte{2});
  EXPECT_FALSE(reassembly.add(fragment_of(ones, 8, true)));
  EXPECT_FALSE(reassembly.add(fragment_of(twos, 0, true)));
  const auto whole = reassembly.add(fragment_of(std::span(twos).first(3), 24, false));
  ASSERT_TRUE(whole.has_value());
  ASSERT_EQ(whole->size(), 27u);
  for (std::size_t i = 0; i < 27; ++i)
    EXPECT_EQ((*whole)[i], i >= 8 && i < 24 ? std::byte{1} : std::byte{2}) << i;
}

TEST(OusterReassembly, ContradictionsGiveThePacketUp) {
  IpReassembly reassembly;
  const Bytes bytes(64);
  EXPECT_FALSE(reassembly.add(fragment_of(bytes, 64, false)));  // 128 bytes in all
  EXPECT_FALSE(reassembly.add(fragment_of(bytes, 128, true)));  // beyond
  EXPECT_EQ(reassembly.lost(), 1u);
  EXPECT_FALSE(reassembly.add(fragment_of(bytes, 64, true)));
  EXPECT_FALSE(reassembly.add(fragment_of(bytes, 0, false)));  // ends before what is there
  EXPECT_EQ(reassembly.lost(), 2u);
  EXPECT_EQ(reassembly.pending(), 0u);
}

TEST(OusterReassembly, FragmentsThatCannotBeAreIgnored) {
  IpReassembly reassembly;
  const Bytes bytes(100);
  EXPECT_FALSE(reassembly.add(fragment_of(bytes, 0, true)));       // not a multiple of 8
  EXPECT_FALSE(reassembly.add(fragment_of(bytes, 4, false)));      // nor its start
  EXPECT_FALSE(reassembly.add(fragment_of({}, 8, false)));         // empty
  EXPECT_FALSE(reassembly.add(fragment_of(bytes, 65528, false)));  // beyond 64 KiB
  EXPECT_EQ(reassembly.pending(), 0u);
}

TEST(OusterReassembly, HoldsOnlySoManyPacketsAndNotForEver) {
  IpReassembly reassembly;
  const Bytes bytes(8);
  for (int id = 0; id < 100; ++id)
    EXPECT_FALSE(reassembly.add(fragment_of(bytes, 0, true, static_cast<std::uint16_t>(id))));
  EXPECT_EQ(reassembly.pending(), IpReassembly::kPackets);
  EXPECT_EQ(reassembly.lost(), 100 - IpReassembly::kPackets);
  for (std::uint64_t i = 0; i <= IpReassembly::kPatience; ++i)
    EXPECT_FALSE(reassembly.add(fragment_of(bytes, 8, true, 500)));
  EXPECT_EQ(reassembly.pending(), 1u);
  EXPECT_EQ(reassembly.lost(), 100u);
}

TEST(OusterCapture, ATruncatedFileGivesWhatWasWhole) {
  const Bytes whole = pcap_file({ethernet(ipv4_packet(udp_packet(payload_of(100)))),
                                 ethernet(ipv4_packet(udp_packet(payload_of(200))))});
  const std::size_t second = 24 + 16 + 14 + 20 + 8 + 100;
  for (const std::size_t size : {second + 4, second + 16, second + 60, whole.size() - 1}) {
    const Capture got = read_capture(Bytes(whole.begin(), whole.begin() + static_cast<int>(size)));
    ASSERT_EQ(got.payloads.size(), 1u) << size;
    EXPECT_THAT(got.problem,
                AllOf(HasSubstr("test.pcap: damaged after 1 datagrams"), Not(HasSubstr("\n"))));
  }
}

TEST(OusterCapture, FilesAreReadLikeBytesAndErrorsNameThem) {
  const test::TempDir dir;
  const Bytes bytes = pcap_file({ethernet(ipv4_packet(udp_packet(payload_of(100))))});
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  auto reader = PcapReader::open(dir.write("a.pcap", text));
  ASSERT_TRUE(reader.ok());
  PcapReader moved = std::move(*reader);
  const auto datagram = moved.next();
  ASSERT_TRUE(datagram.ok() && *datagram);
  EXPECT_EQ((*datagram)->payload.size(), 100u);
  EXPECT_FALSE(*moved.next());
  const auto missing = PcapReader::open(dir / "none.pcap");
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().cause, Error::Cause::not_found);
  EXPECT_THAT(missing.error().message, HasSubstr("none.pcap"));
  const auto other = PcapReader::open(dir.write("b.pcap", "no capture at all, just some text"));
  ASSERT_FALSE(other.ok());
  EXPECT_THAT(other.error().message,
              AllOf(HasSubstr("b.pcap: no pcap or pcapng capture"), Not(HasSubstr("\n"))));
  EXPECT_FALSE(PcapReader::open(Bytes(), "empty").ok());
}

/// A section header, an interface of nanoseconds and one packet.
TEST(OusterCapture, ReadsPcapng) {
  const Bytes payload = payload_of(64);
  const Bytes frame = ethernet(ipv4_packet(udp_packet(payload)));
  Bytes file;
  const auto block = [&](std::uint32_t type, Bytes body) {
    body.resize((body.size() + 3) / 4 * 4);
    const std::size_t size = body.size() + 12;
    Bytes ends(4), head(8);
    test::put(head, 0, 4, type);
    test::put(head, 4, 4, size);
    test::put(ends, 0, 4, size);
    append(file, head);
    append(file, body);
    append(file, ends);
  };
  Bytes section(16, std::byte{0xFF});
  test::put(section, 0, 4, 0x1A2B3C4D);
  test::put(section, 4, 4, 1);
  block(0x0A0D0D0A, section);
  Bytes interface(20);
  test::put(interface, 0, 2, 1);
  test::put(interface, 4, 4, 65535);
  test::put(interface, 8, 2, 9);  // if_tsresol: 10^-9
  test::put(interface, 10, 2, 1);
  test::put(interface, 12, 1, 9);
  block(1, interface);
  Bytes packet(20);
  const std::uint64_t time_ns = 1'700'000'000'123'456'789;
  test::put(packet, 4, 4, time_ns >> 32);
  test::put(packet, 8, 4, time_ns);
  test::put(packet, 12, 4, frame.size());
  test::put(packet, 16, 4, frame.size());
  append(packet, frame);
  block(6, packet);
  const Capture got = read_capture(file);
  EXPECT_EQ(got.problem, "");
  ASSERT_EQ(got.payloads.size(), 1u);
  EXPECT_EQ(got.payloads[0], payload);
  EXPECT_EQ(got.datagrams[0].captured_at, TimePoint(Duration(time_ns)));
}

TEST(OusterCapture, AddressesAsText) {
  for (const std::string text : {"10.0.0.1", "fe80::1:2"}) {
    const auto address = parse_ip_address(text);
    ASSERT_TRUE(address.ok());
    EXPECT_EQ(to_string(*address), text);
  }
  for (const std::string text : {"", "localhost", "1.2.3", "1.2.3.4:5"})
    EXPECT_FALSE(parse_ip_address(text).ok()) << text;
}

// Sockets ---------------------------------------------------------------------------------------

/// Sends from one of our sockets' neighbours: a plain one.
class Sender {
 public:
  explicit Sender(const std::string& to, std::uint16_t port) {
    const IpAddress address = *parse_ip_address(to);
    socket_ = ::socket(address.v6 ? AF_INET6 : AF_INET, SOCK_DGRAM, 0);
    if (address.v6) {
      sockaddr_in6 at{};
      at.sin6_family = AF_INET6;
      at.sin6_port = htons(port);
      std::memcpy(&at.sin6_addr, address.bytes.data(), 16);
      connected_ = ::connect(socket_, reinterpret_cast<sockaddr*>(&at), sizeof at) == 0;
    } else {
      sockaddr_in at{};
      at.sin_family = AF_INET;
      at.sin_port = htons(port);
      std::memcpy(&at.sin_addr, address.bytes.data(), 4);
      connected_ = ::connect(socket_, reinterpret_cast<sockaddr*>(&at), sizeof at) == 0;
    }
  }
  ~Sender() { ::close(socket_); }
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;

  bool send(const Bytes& payload) const {
    return connected_ && ::send(socket_, payload.data(), payload.size(), 0) ==
                             static_cast<::ssize_t>(payload.size());
  }

 private:
  int socket_;
  bool connected_ = false;
};

constexpr Duration kSoon = std::chrono::seconds(2), kNow{};

TEST(OusterSocket, ReceivesWhatIsSent) {
  for (const std::string at : {"", "127.0.0.1"}) {
    auto socket = UdpSocket::bind({.address = at});
    ASSERT_TRUE(socket.ok()) << socket.error().message;
    ASSERT_GT(socket->port(), 0);
    EXPECT_GT(socket->buffer_bytes(), 65536u);
    const Sender sender("127.0.0.1", socket->port());
    const Bytes large = payload_of(33024), small = payload_of(48);
    ASSERT_TRUE(sender.send(large) && sender.send(small));
    for (const Bytes& sent : {large, small}) {
      const auto got = socket->receive(kSoon);
      ASSERT_TRUE(got.ok() && *got);
      EXPECT_EQ(Bytes((*got)->payload.begin(), (*got)->payload.end()), sent);
      EXPECT_EQ(to_string((*got)->from.address), "127.0.0.1");
      EXPECT_EQ((*got)->to.port, socket->port());
      const Duration age = std::chrono::system_clock::now() - (*got)->captured_at;
      EXPECT_LT(std::chrono::abs(age), std::chrono::seconds(10));
    }
    EXPECT_EQ(socket->dropped(), 0u);
  }
}

TEST(OusterSocket, NothingInTimeIsNoError) {
  auto socket = UdpSocket::bind({.address = "127.0.0.1"});
  ASSERT_TRUE(socket.ok());
  UdpSocket moved = std::move(*socket);
  const auto got = moved.receive(kNow);
  EXPECT_TRUE(got.ok() && !*got);
}

TEST(OusterSocket, ReceivesIpv6) {
  auto socket = UdpSocket::bind({.address = "::1"});
  if (!socket) GTEST_SKIP() << "no IPv6 here: " << socket.error().message;
  const Sender sender("::1", socket->port());
  ASSERT_TRUE(sender.send(payload_of(100)));
  const auto got = socket->receive(kSoon);
  ASSERT_TRUE(got.ok() && *got);
  EXPECT_EQ(to_string((*got)->from.address), "::1");
}

TEST(OusterSocket, ErrorsNameThePortOrAddress) {
  auto socket = UdpSocket::bind({.address = "127.0.0.1"});
  ASSERT_TRUE(socket.ok());
  const auto again = UdpSocket::bind({.address = "127.0.0.1", .port = socket->port()});
  ASSERT_FALSE(again.ok());
  EXPECT_THAT(again.error().message, HasSubstr(std::to_string(socket->port())));
  const auto bad = UdpSocket::bind({.address = "nowhere"});
  ASSERT_FALSE(bad.ok());
  EXPECT_THAT(bad.error().message, HasSubstr("UDP address"));
}

}  // namespace
}  // namespace mr::sensor::ouster_capture_test
