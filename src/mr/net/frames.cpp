#include "mr/net/frames.h"

#include <algorithm>
#include <utility>

#include "mr/net/little_endian.h"

namespace mr::net {

std::array<std::byte, kFrameHeaderBytes> encode_frame_header(FrameKind kind, std::uint64_t id,
                                                             std::size_t payload_bytes) {
  std::array<std::byte, kFrameHeaderBytes> header{};
  std::byte* at = put(header.data(), static_cast<std::uint32_t>(payload_bytes));
  at = put(at, static_cast<std::uint8_t>(kind));
  put(at, id);
  return header;
}

void FrameReader::take_into(std::vector<std::byte>& to, std::size_t wanted,
                            std::span<const std::byte>& from) {
  const std::size_t n = std::min(wanted - to.size(), from.size());
  to.insert(to.end(), from.begin(), from.begin() + static_cast<std::ptrdiff_t>(n));
  from = from.subspan(n);
}

Status FrameReader::read_header() {
  std::span<const std::byte> bytes = header_;
  length_ = take<std::uint32_t>(bytes);
  const auto kind = take<std::uint8_t>(bytes);
  frame_ = {static_cast<FrameKind>(kind), take<std::uint64_t>(bytes), {}};
  const auto limit = limits_.find(frame_.kind);
  if (limit == limits_.end()) return Error{Error::Cause::corrupt, "unexpected kind of frame"};
  if (length_ > limit->second) return Error{Error::Cause::too_large, "frame too large"};
  frame_.payload.reserve(std::min<std::size_t>(length_, 1u << 16));
  return {};
}

Result<std::vector<Frame>> FrameReader::feed(std::span<const std::byte> bytes) {
  std::vector<Frame> frames;
  while (true) {
    if (header_.size() < kFrameHeaderBytes) {
      take_into(header_, kFrameHeaderBytes, bytes);
      if (header_.size() < kFrameHeaderBytes) return frames;
      if (auto ok = read_header(); !ok) return ok.error();
    }
    take_into(frame_.payload, length_, bytes);
    if (frame_.payload.size() < length_) return frames;
    frames.push_back(std::exchange(frame_, {}));
    header_.clear();
  }
}

}  // namespace mr::net
