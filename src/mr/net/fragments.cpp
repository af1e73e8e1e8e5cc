#include "mr/net/fragments.h"

#include <algorithm>
#include <utility>

#include "mr/net/little_endian.h"

namespace mr::net {
namespace {

constexpr std::uint32_t kMagic = 0x3147524D;  // "MRG1"

}  // namespace

Result<std::uint16_t> fragment_count(std::size_t message_bytes, std::size_t max_payload) {
  if (max_payload <= kFragmentHeaderBytes)
    return Error{Error::Cause::too_large, "the server's max_payload leaves no room for a message"};
  const std::size_t room = max_payload - kFragmentHeaderBytes;
  const std::size_t parts = std::max<std::size_t>(1, (message_bytes + room - 1) / room);
  if (parts > 0xFFFF)
    return Error{Error::Cause::too_large, "too many parts for the server's max_payload"};
  return static_cast<std::uint16_t>(parts);
}

std::vector<std::byte> fragment(std::span<const std::byte> message, std::uint64_t id,
                                std::uint16_t part, std::uint16_t parts, std::size_t max_payload) {
  const std::size_t room = max_payload - kFragmentHeaderBytes;
  const std::size_t from = std::min(message.size(), part * room);
  const auto bytes = message.subspan(from, std::min(room, message.size() - from));
  std::vector<std::byte> out(kFragmentHeaderBytes + bytes.size());
  std::byte* at = put(put(put(put(out.data(), kMagic), id), part), parts);
  std::copy(bytes.begin(), bytes.end(), at);
  return out;
}

void Reassembly::lose(Partials::iterator at) {
  ++lost_;
  last_lost_ = at->first;
  held_ -= at->second.bytes.size();
  partials_.erase(at);
}

void Reassembly::lose_late(TimePoint now) {
  for (auto at = partials_.begin(); at != partials_.end();) {
    const auto late = at++;
    if (late->second.until <= now) lose(late);
  }
}

Message Reassembly::append(Partials::iterator at, TimePoint now, std::span<const std::byte> bytes) {
  Partial& partial = at->second;
  if (partial.bytes.size() + bytes.size() > limits_.message_bytes ||
      held_ + bytes.size() > limits_.bytes) {
    lose(at);
    return nullptr;
  }
  partial.bytes.insert(partial.bytes.end(), bytes.begin(), bytes.end());
  held_ += bytes.size();
  partial.until = now + limits_.patience;
  if (++partial.next < partial.parts) return nullptr;
  held_ -= partial.bytes.size();
  auto whole = as_message(std::move(partial.bytes));
  partials_.erase(at);
  return whole;
}

Message Reassembly::accept(TimePoint now, std::span<const std::byte> bytes) {
  lose_late(now);
  if (bytes.size() < kFragmentHeaderBytes || take<std::uint32_t>(bytes) != kMagic) {
    ++lost_;
    return nullptr;
  }
  const auto id = take<std::uint64_t>(bytes);
  const auto part = take<std::uint16_t>(bytes);
  const auto parts = take<std::uint16_t>(bytes);
  auto at = partials_.find(id);
  const bool fits = at == partials_.end() ? part == 0 && parts > 0
                                          : part == at->second.next && parts == at->second.parts;
  if (!fits) {
    if (at != partials_.end())
      lose(at);
    else if (std::exchange(last_lost_, id) != id)  // not yet another part of the same loss
      ++lost_;
    return nullptr;
  }
  if (at == partials_.end()) {
    if (partials_.size() >= limits_.messages)
      lose(std::min_element(partials_.begin(), partials_.end(), [](const auto& a, const auto& b) {
        return a.second.until < b.second.until;
      }));
    at = partials_.emplace(id, Partial{parts, 0, {}, {}}).first;
  }
  return append(at, now, bytes);
}

}  // namespace mr::net
