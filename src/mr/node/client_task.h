#pragma once

#include <optional>
#include <string>

#include "mr/codec/stream_receiver.h"
#include "mr/core/decoded_scene.h"
#include "mr/node/task.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// Who watches a scene: decodes the root's packets and asks for what is missing.
class ClientTask final : public Task {
 public:
  /// `root`: whose packets it takes. The scene's lattice is copied.
  ClientTask(const Scene& scene, NodeLog log);

  const std::string& id() const override { return id_; }
  std::vector<std::string> inputs() const override { return {root_}; }
  std::vector<Ask> step(const Arrivals& arrivals, TimePoint now) override;
  Bytes answer(const codec::Control&, TimePoint) override { return {}; }
  NodeStats stats(TimePoint now) const override;

  /// The newest packet that could be read, as it came.
  const std::optional<Packet>& newest() const { return newest_; }
  /// The newest capture that is whole; nothing while something of the newest packet is missing.
  std::optional<DecodedScene> scene() const { return stream_.decoded().scene(); }

 private:
  std::string id_ = "client", root_;
  codec::StreamReceiver stream_;
  std::optional<Packet> newest_;
  DropCounter drops_;
};

}  // namespace mr::node
