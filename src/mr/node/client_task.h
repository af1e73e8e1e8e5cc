#pragma once

#include <optional>
#include <string>

#include "mr/codec/stream_receiver.h"
#include "mr/core/decoded_scene.h"
#include "mr/node/task.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// A client of a scene: decodes the root's packets and requests missing data.
class ClientTask final : public Task {
 public:
  /// Takes the packets of the scene's root. The scene's lattice is copied.
  ClientTask(const Scene& scene, NodeLog log);

  const std::string& id() const override { return id_; }
  std::vector<std::string> inputs() const override { return {root_}; }
  std::vector<Ask> step(const Arrivals& arrivals, TimePoint now) override;
  Bytes answer(const codec::Control&, TimePoint) override { return {}; }
  NodeStats stats(TimePoint now) const override;

  /// The newest packet that could be decoded, unchanged.
  const std::optional<Packet>& newest() const { return newest_; }
  /// The newest complete capture; nothing while data of the newest packet is missing.
  std::optional<DecodedScene> scene() const { return stream_.decoded().scene(); }

 private:
  std::string id_ = "client", root_;
  codec::StreamReceiver stream_;
  std::optional<Packet> newest_;
  DropCounter drops_;
};

}  // namespace mr::node
