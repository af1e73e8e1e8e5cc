#pragma once

#include <span>

#include "mr/net/outbox.h"

namespace mr::node {

/// Folds encoded packets of one node, oldest first, into one packet: for the queues in front of
/// slow receivers (net::Outbox). Reads heads only: payloads stay coded, and are copied once, into
/// the folded packet.
net::Message coalesce_packets(std::span<const net::Message> packets);

}  // namespace mr::node
