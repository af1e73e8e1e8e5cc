#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

namespace mr::node {

/// Acknowledges still surfaces to a merger's inputs. An input goes on sending as moving what has
/// become still until it hears that its still surface is shown: from the root once that publishes
/// it, through an inner merger once the node above has said so.
class StillReceipts {
 public:
  using Sequences = std::map<std::size_t, std::uint64_t>;  ///< of packets, by input

  explicit StillReceipts(bool is_root) : is_root_(is_root) {}

  /// A tick uses these packets.
  void note_taken(const std::vector<std::pair<std::size_t, std::uint64_t>>& packets) {
    for (const auto& [input, sequence] : packets) taken_[input] = sequence;
  }
  /// The newest of each input.
  const Sequences& taken() const { return taken_; }

  /// The node's packet `sequence` brings a still surface made of the inputs' packets `inputs`;
  /// nothing: of the same as before. `is_whole`: no triangle of it is withheld. A root's is told
  /// once it was sent: see release().
  void publish(std::optional<Sequences> inputs, bool is_whole, std::uint64_t sequence);

  /// The root has sent all still surface that was published for packets before this one.
  void release(std::uint64_t before);

  /// The node above shows the still surface of this node's packet `sequence`. Any thread.
  void acknowledge(std::uint64_t sequence);

  /// Inputs to be told that their still surface is shown, with the sequence of the packet that had
  /// it; each once. Any thread.
  std::vector<std::pair<std::size_t, std::uint64_t>> take();

 private:
  void merge_oldest();

  bool is_root_;
  Sequences taken_;
  Sequences not_whole_;                        ///< published with triangles withheld
  std::map<std::uint64_t, Sequences> unsent_;  ///< by the root, by own sequence
  std::mutex mutex_;
  Sequences shown_;                                          ///< not told yet
  std::deque<std::pair<std::uint64_t, Sequences>> waiting_;  ///< own sequence, what it brought
};

}  // namespace mr::node
