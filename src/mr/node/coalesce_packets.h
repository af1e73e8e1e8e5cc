#pragma once

#include <span>

#include "mr/net/outbox.h"

namespace mr::node {

/// Folds encoded packets of one node, oldest first, into one packet: for the queues in front of
/// slow receivers (net::Outbox).
net::Message coalesce_packets(std::span<const net::Message> packets);

}  // namespace mr::node
