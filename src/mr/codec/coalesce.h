#pragma once

#include <span>

#include "mr/core/packet.h"
#include "mr/core/result.h"

namespace mr::codec {

/// Whether a packet may be folded into the one after it: same node and epoch, nothing between.
bool can_fold(const Packet& older, const Packet& newer);

/// Folds a packet into the one after it (DESIGN section 4, Queues): newest manifest, the newest
/// payload of each chunk that it names, texture units of both in order.
Packet fold(Packet older, Packet newer);

/// At most so many units of one stream are folded into a packet: the receiver has to decode them
/// all.
inline constexpr std::size_t kMaxFoldedUnits = 64;

/// Folds the newest of the given packets, oldest first, as long as they go together and the result
/// is within kMaxFoldedUnits and PacketLimits; the rest is given up, which the receiver sees as a
/// gap in the sequence.
Packet coalesce(std::span<Packet> packets);

}  // namespace mr::codec
