#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/result.h"
#include "mr/net/printable.h"

namespace mr::net {

/// The frames of the TCP transport: a header {u32 payload length, u8 kind, u64 id}, little endian,
/// then the payload. The connecting side begins with `hello` and may then subscribe and send
/// requests at any time.
enum class FrameKind : std::uint8_t {
  hello = 1,  ///< payload: kHello and the node's name
  subscribe,  ///< to the packets of the node, from now on
  unsubscribe,
  packet,
  request,   ///< id: chosen by the sender; 0: no answer is wanted
  answer,    ///< id: that of the request
  refusal,   ///< payload: why the connection ends, a line of text
  duplicate  ///< instead of hello; payload: a node that the sender runs, too
};

struct Frame {
  FrameKind kind = FrameKind::hello;
  std::uint64_t id = 0;
  std::vector<std::byte> payload;
};

inline constexpr std::size_t kFrameHeaderBytes = 13;
inline constexpr std::string_view kHello = "MRT1";  ///< the node's name follows
inline constexpr std::size_t kLongestName = 255;
inline constexpr std::size_t kLongestRefusal = kLongestPrintable;

/// The bytes before a payload of less than 4 GB.
std::array<std::byte, kFrameHeaderBytes> encode_frame_header(FrameKind kind, std::uint64_t id,
                                                             std::size_t payload_bytes);

/// Largest payload of each kind that is accepted; kinds not named are not.
using FrameLimits = std::map<FrameKind, std::size_t>;

/// Cuts a byte stream into frames. No socket inside.
class FrameReader {
 public:
  explicit FrameReader(FrameLimits limits) : limits_(std::move(limits)) {}

  /// Takes the next bytes, any number; returns the frames that they complete. Errors corrupt,
  /// too_large: the rest of the stream cannot be read. Memory grows with the bytes received, not
  /// with the length that a header claims.
  Result<std::vector<Frame>> feed(std::span<const std::byte> bytes);

 private:
  Status read_header();
  void take_into(std::vector<std::byte>& to, std::size_t wanted, std::span<const std::byte>& from);

  FrameLimits limits_;
  std::vector<std::byte> header_;
  std::size_t length_ = 0;  ///< of the frame whose header is complete
  Frame frame_;
};

}  // namespace mr::net
