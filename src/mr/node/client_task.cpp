#include "mr/node/client_task.h"

#include <utility>

namespace mr::node {

ClientTask::ClientTask(const Scene& scene, NodeLog log)
    : root_(scene.mergers.back().id), stream_(scene.lattice, scene.id, root_) {
  drops_.set_listener(std::move(log.dropped));
}

std::vector<Ask> ClientTask::step(const Arrivals& arrivals, TimePoint now) {
  for (const Arrivals::Packet& arrived : arrivals.packets) {
    auto packet = stream_.read(*arrived.bytes, now);
    if (!packet) {
      drops_.count(id_, packet.error());
      continue;
    }
    for (const Error& error : stream_.accept(*packet)) drops_.count(id_, error);
    newest_ = *std::move(packet);
  }
  for (const Arrivals::Answer& answer : arrivals.answers)
    for (const Error& error : stream_.take_answer(*answer.bytes)) drops_.count(id_, error);
  codec::Control request = stream_.wanted(now);
  if (request.empty()) return {};
  return {{0, std::move(request)}};
}

NodeStats ClientTask::stats(TimePoint) const { return {.id = id_, .drops = drops_.by_cause()}; }

}  // namespace mr::node
