#include "mr/sensor/ouster/ip_reassembly.h"

#include <algorithm>

namespace mr::sensor {
namespace {

constexpr std::size_t kUnit = 8;  ///< bytes: what fragment offsets count

std::size_t units_of(std::size_t bytes) { return (bytes + kUnit - 1) / kUnit; }

}  // namespace

std::optional<std::span<const std::byte>> IpReassembly::add(const IpFragment& fragment) {
  ++fragments_;
  give_up_stale();
  const std::size_t end = fragment.offset + fragment.bytes.size();
  if (fragment.bytes.empty() || fragment.offset % kUnit != 0 || end > kPacketBytes ||
      (fragment.more && fragment.bytes.size() % kUnit != 0))
    return std::nullopt;
  Partial& partial = partial_of(fragment);  // the first of the list
  if (contradicts(partial, fragment)) {
    partials_.pop_front();
    ++lost_;
    return std::nullopt;
  }
  if (!fragment.more) partial.size = end;
  copy_new(partial, fragment);
  if (!partial.size || partial.received_count < units_of(*partial.size)) return std::nullopt;
  complete_ = std::move(partial.bytes);
  complete_.resize(*partial.size);
  partials_.pop_front();
  return complete_;
}

IpReassembly::Partial& IpReassembly::partial_of(const IpFragment& f) {
  const auto at = std::ranges::find_if(partials_, [&](const Partial& p) {
    return p.id == f.id && p.protocol == f.protocol && p.from == f.from && p.to == f.to;
  });
  if (at != partials_.end()) {
    partials_.splice(partials_.begin(), partials_, at);
  } else {
    if (partials_.size() == kPackets) partials_.pop_back(), ++lost_;
    Partial& fresh = partials_.emplace_front();
    fresh.from = f.from;
    fresh.to = f.to;
    fresh.id = f.id;
    fresh.protocol = f.protocol;
  }
  partials_.front().last_at = fragments_;
  return partials_.front();
}

void IpReassembly::give_up_stale() {
  while (!partials_.empty() && fragments_ - partials_.back().last_at > kPatience)
    partials_.pop_back(), ++lost_;
}

bool IpReassembly::contradicts(const Partial& partial, const IpFragment& fragment) {
  const std::size_t end = fragment.offset + fragment.bytes.size();
  if (partial.size && (end > *partial.size || (!fragment.more && end != *partial.size)))
    return true;
  return !fragment.more && partial.bytes.size() > end;
}

void IpReassembly::copy_new(Partial& partial, const IpFragment& fragment) {
  const std::size_t end = fragment.offset + fragment.bytes.size();
  if (partial.bytes.size() < end) partial.bytes.resize(end);
  if (partial.received.size() < units_of(end)) partial.received.resize(units_of(end));
  for (std::size_t at = fragment.offset; at < end; at += kUnit) {
    if (partial.received[at / kUnit]) continue;
    partial.received[at / kUnit] = true;
    ++partial.received_count;
    const std::size_t count = std::min(kUnit, end - at);
    std::copy_n(fragment.bytes.begin() + static_cast<std::ptrdiff_t>(at - fragment.offset), count,
                partial.bytes.begin() + static_cast<std::ptrdiff_t>(at));
  }
}

}  // namespace mr::sensor
