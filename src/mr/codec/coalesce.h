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

/// Folds as many of the given packets, oldest first, as go together with the newest and hold no
/// more texture units than a packet may; the rest is given up, which the receiver sees as a gap in
/// the sequence.
Packet coalesce(std::span<Packet> packets);

}  // namespace mr::codec
