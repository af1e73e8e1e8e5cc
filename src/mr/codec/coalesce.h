#pragma once

#include <span>

#include "mr/codec/packet_message.h"

namespace mr::codec {

/// Whether a packet may be folded into the one after it: same epoch, nothing between, and it can be
/// told which of its chunks the newer manifest names.
bool can_fold(const PacketMessage& older, const PacketMessage& newer);

/// Folds a packet into the one after it: newest manifest, the newest
/// payload of each chunk that it names, texture units of both in order, the base that the newer one
/// builds on if one of them brings it.
PacketMessage fold(PacketMessage older, PacketMessage newer);

/// At most so many units of one stream are folded into a packet: the receiver has to decode them
/// all.
inline constexpr std::size_t kMaxFoldedUnits = 64;

/// Folds the newest of the given packets, oldest first, as long as they go together and the result
/// is within kMaxFoldedUnits and PacketLimits; the rest is given up, which the receiver sees as a
/// gap in the streams' serials.
PacketMessage coalesce(std::span<PacketMessage> packets);

}  // namespace mr::codec
