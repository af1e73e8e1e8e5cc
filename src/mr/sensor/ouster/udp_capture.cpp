#include "mr/sensor/ouster/udp_capture.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <pcap/pcap.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "mr/sensor/ouster/ip_reassembly.h"

namespace mr::sensor {
namespace {

using CapturedBytes = std::span<const std::byte>;

constexpr std::uint16_t kEtherIpv4 = 0x0800, kEtherIpv6 = 0x86DD;
constexpr std::uint8_t kProtocolUdp = 17;

std::uint16_t big_endian16(CapturedBytes bytes, std::size_t at) {
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(bytes[at]) << 8 |
                                    std::to_integer<unsigned>(bytes[at + 1]));
}
std::uint8_t byte_at(CapturedBytes bytes, std::size_t at) {
  return std::to_integer<std::uint8_t>(bytes[at]);
}

/// What a frame holds, and why nothing of it was delivered.
enum class FrameContent { datagram, other, damaged, fragment };

/// The IP packet of an Ethernet frame; nothing: of another protocol, or too short.
std::optional<CapturedBytes> ip_of_ethernet(CapturedBytes frame) {
  constexpr std::uint16_t kVlan = 0x8100, kServiceVlan = 0x88A8;
  for (std::size_t type_at = 12; type_at + 2 <= frame.size(); type_at += 4) {
    const std::uint16_t type = big_endian16(frame, type_at);
    if (type == kEtherIpv4 || type == kEtherIpv6) return frame.subspan(type_at + 2);
    if (type != kVlan && type != kServiceVlan) break;
  }
  return std::nullopt;
}

/// The IP packet behind a header of fixed size with its protocol at `type_at`.
std::optional<CapturedBytes> ip_of_cooked(CapturedBytes frame, std::size_t type_at,
                                          std::size_t header) {
  if (frame.size() < header) return std::nullopt;
  const std::uint16_t type = big_endian16(frame, type_at);
  if (type != kEtherIpv4 && type != kEtherIpv6) return std::nullopt;
  return frame.subspan(header);
}

bool is_known_link(int link) {
  switch (link) {
    case DLT_EN10MB:
    case DLT_LINUX_SLL:
    case DLT_LINUX_SLL2:
    case DLT_RAW:
    case DLT_IPV4:
    case DLT_IPV6:
    case DLT_NULL:
    case DLT_LOOP:
      return true;
    default:
      return false;
  }
}

std::optional<CapturedBytes> ip_of_frame(int link, CapturedBytes frame) {
  switch (link) {
    case DLT_EN10MB:
      return ip_of_ethernet(frame);
    case DLT_LINUX_SLL:
      return ip_of_cooked(frame, 14, 16);
    case DLT_LINUX_SLL2:
      return ip_of_cooked(frame, 0, 20);
    case DLT_NULL:
    case DLT_LOOP:  // a protocol family, whose numbers differ by system; the IP version tells
      return frame.size() < 4 ? std::nullopt : std::optional(frame.subspan(4));
    default:
      return frame;
  }
}

/// Fills ports and payload of a UDP packet. False: shorter than it says.
bool read_udp(CapturedBytes packet, Datagram& out) {
  constexpr std::size_t kHeader = 8;
  if (packet.size() < kHeader) return false;
  const std::size_t size = big_endian16(packet, 4);
  if (size < kHeader || size > packet.size()) return false;
  out.from.port = big_endian16(packet, 0);
  out.to.port = big_endian16(packet, 2);
  out.payload = packet.subspan(kHeader, size - kHeader);
  return true;
}

IpAddress address_at(CapturedBytes packet, std::size_t at, bool v6) {
  IpAddress out;
  out.v6 = v6;
  for (std::size_t i = 0; i < (v6 ? 16u : 4u); ++i) out.bytes[i] = byte_at(packet, at + i);
  return out;
}

FrameContent read_ipv6(CapturedBytes packet, Datagram& out) {
  constexpr std::size_t kHeader = 40;
  if (packet.size() < kHeader) return FrameContent::damaged;
  const std::size_t size = big_endian16(packet, 4);
  if (byte_at(packet, 6) != kProtocolUdp) return FrameContent::other;
  if (size > packet.size() - kHeader) return FrameContent::damaged;
  out.from.address = address_at(packet, 8, true);
  out.to.address = address_at(packet, 24, true);
  return read_udp(packet.subspan(kHeader, size), out) ? FrameContent::datagram
                                                      : FrameContent::damaged;
}

FrameContent read_ipv4(CapturedBytes packet, IpReassembly& reassembly, Datagram& out) {
  if (packet.size() < 20) return FrameContent::damaged;
  const std::size_t header = (byte_at(packet, 0) & 0xFu) * 4;
  const std::size_t told = big_endian16(packet, 2);
  const std::size_t size = told == 0 ? packet.size() : told;  // 0: left to the network card
  if (byte_at(packet, 9) != kProtocolUdp) return FrameContent::other;
  if (header < 20 || size < header || size > packet.size()) return FrameContent::damaged;
  const std::uint16_t flags = big_endian16(packet, 6);
  out.from.address = address_at(packet, 12, false);
  out.to.address = address_at(packet, 16, false);
  CapturedBytes udp = packet.subspan(header, size - header);
  const bool more = (flags & 0x2000) != 0;
  const std::size_t offset = (flags & 0x1FFFu) * 8;
  if (more || offset > 0) {
    const auto whole = reassembly.add({.from = out.from.address,
                                       .to = out.to.address,
                                       .id = big_endian16(packet, 4),
                                       .protocol = kProtocolUdp,
                                       .offset = offset,
                                       .more = more,
                                       .bytes = udp});
    if (!whole) return FrameContent::fragment;
    udp = *whole;
  }
  return read_udp(udp, out) ? FrameContent::datagram : FrameContent::damaged;
}

FrameContent read_frame(int link, CapturedBytes frame, IpReassembly& reassembly, Datagram& out) {
  const auto packet = ip_of_frame(link, frame);
  if (!packet || packet->empty()) return FrameContent::other;
  const int version = byte_at(*packet, 0) >> 4;
  if (version == 4) return read_ipv4(*packet, reassembly, out);
  return version == 6 ? read_ipv6(*packet, out) : FrameContent::other;
}

/// The epoch for times that do not fit. With nanosecond precision, tv_usec holds nanoseconds.
TimePoint time_of(const timeval& time) {
  constexpr std::int64_t kMost_s = std::int64_t{1} << 33;
  if (time.tv_sec < 0 || time.tv_sec > kMost_s || time.tv_usec < 0 || time.tv_usec > 999999999)
    return {};
  return TimePoint(std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_usec));
}

/// A library's message on one line.
std::string one_line(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return static_cast<unsigned char>(c) < 0x20; }, ' ');
  return text;
}

}  // namespace

std::string to_string(const IpAddress& address) {
  char text[INET6_ADDRSTRLEN] = "";
  ::inet_ntop(address.v6 ? AF_INET6 : AF_INET, address.bytes.data(), text, sizeof text);
  return text;
}

Result<IpAddress> parse_ip_address(const std::string& text) {
  IpAddress out;
  if (::inet_pton(AF_INET, text.c_str(), out.bytes.data()) == 1) return out;
  out.v6 = true;
  if (::inet_pton(AF_INET6, text.c_str(), out.bytes.data()) == 1) return out;
  return Error{Error::Cause::invalid, "must be a numeric IPv4 or IPv6 address"};
}

struct PcapReader::Impl {
  struct Close {
    void operator()(pcap_t* opened) const { ::pcap_close(opened); }
  };
  std::unique_ptr<pcap_t, Close> handle;
  std::string name;
  int link = 0;
  bool ended = false;
  IpReassembly reassembly;
  Counts counts;

  static Result<std::unique_ptr<Impl>> open(std::FILE* file, const std::string& name);
  FrameContent read(const pcap_pkthdr& header, const unsigned char* bytes, Datagram& out);
};

/// Takes the file.
Result<std::unique_ptr<PcapReader::Impl>> PcapReader::Impl::open(std::FILE* file,
                                                                 const std::string& name) {
  char problem[PCAP_ERRBUF_SIZE] = "";
  auto impl = std::make_unique<Impl>();
  impl->handle.reset(
      ::pcap_fopen_offline_with_tstamp_precision(file, PCAP_TSTAMP_PRECISION_NANO, problem));
  if (!impl->handle) {
    std::fclose(file);
    return Error{Error::Cause::corrupt, name + ": no pcap or pcapng capture: " + one_line(problem)};
  }
  impl->name = name;
  impl->link = ::pcap_datalink(impl->handle.get());
  if (is_known_link(impl->link)) return impl;
  return Error{Error::Cause::unsupported,
               fmt::format("{}: link type {} is not supported; supported are Ethernet, Linux SLL "
                           "and SLL2, raw IP and loopback",
                           name, impl->link)};
}

FrameContent PcapReader::Impl::read(const pcap_pkthdr& header, const unsigned char* bytes,
                                    Datagram& out) {
  out.captured_at = time_of(header.ts);
  const FrameContent content =
      read_frame(link, std::as_bytes(std::span(bytes, header.caplen)), reassembly, out);
  if (content == FrameContent::datagram) ++counts.datagrams;
  if (content == FrameContent::other) ++counts.other;
  if (content == FrameContent::damaged) ++counts.damaged;
  return content;
}

PcapReader::PcapReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PcapReader::PcapReader(PcapReader&&) noexcept = default;
PcapReader& PcapReader::operator=(PcapReader&&) noexcept = default;
PcapReader::~PcapReader() = default;

Result<PcapReader> PcapReader::open(const std::filesystem::path& file) {
  std::FILE* const opened = std::fopen(file.c_str(), "rbe");
  if (opened == nullptr)
    return Error{errno == ENOENT ? Error::Cause::not_found : Error::Cause::io,
                 file.string() + ": " + std::strerror(errno)};
  auto impl = Impl::open(opened, file.string());
  if (!impl) return impl.error();
  return PcapReader(std::move(*impl));
}

Result<PcapReader> PcapReader::open(std::span<const std::byte> bytes, const std::string& name) {
  if (bytes.empty()) return Error{Error::Cause::corrupt, name + ": empty"};
  // Opened for reading only: the bytes are not changed.
  std::FILE* const opened = ::fmemopen(const_cast<std::byte*>(bytes.data()), bytes.size(), "rb");
  if (opened == nullptr) return Error{Error::Cause::io, name + ": " + std::strerror(errno)};
  auto impl = Impl::open(opened, name);
  if (!impl) return impl.error();
  return PcapReader(std::move(*impl));
}

Result<std::optional<Datagram>> PcapReader::next() {
  while (!impl_->ended) {
    pcap_pkthdr* header = nullptr;
    const unsigned char* bytes = nullptr;
    const int got = ::pcap_next_ex(impl_->handle.get(), &header, &bytes);
    if (got == 1) {
      Datagram datagram;
      if (impl_->read(*header, bytes, datagram) == FrameContent::datagram)
        return std::optional(datagram);
      continue;
    }
    impl_->ended = true;
    if (got == PCAP_ERROR_BREAK) break;
    return Error{Error::Cause::corrupt, fmt::format("{}: damaged after {} datagrams: {}",
                                                    impl_->name, impl_->counts.datagrams,
                                                    one_line(::pcap_geterr(impl_->handle.get())))};
  }
  return std::optional<Datagram>();
}

PcapReader::Counts PcapReader::counts() const {
  Counts out = impl_->counts;
  out.incomplete = impl_->reassembly.lost() + (impl_->ended ? impl_->reassembly.pending() : 0);
  return out;
}

}  // namespace mr::sensor
