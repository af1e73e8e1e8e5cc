#include "mr/node/still_receipts.h"

namespace mr::node {
namespace {

constexpr std::size_t kMostWaiting = 64;

}  // namespace

void StillReceipts::publish(std::optional<Sequences> inputs, bool is_whole,
                            std::uint64_t sequence) {
  if (inputs) not_whole_ = *std::move(inputs);
  if (not_whole_.empty() || !is_whole) return;
  Sequences brought = std::exchange(not_whole_, {});
  if (is_root_) {
    for (const auto& [input, packet] : brought) unsent_[sequence][input] = packet;
    if (unsent_.size() > kMostWaiting) merge_oldest();
    return;
  }
  const std::lock_guard lock(mutex_);
  waiting_.emplace_back(sequence, std::move(brought));
  if (waiting_.size() > kMostWaiting) waiting_.pop_front();
}

/// The oldest two are told with the second of them.
void StillReceipts::merge_oldest() {
  auto oldest = unsent_.extract(unsent_.begin());
  unsent_.begin()->second.merge(std::move(oldest.mapped()));
}

void StillReceipts::release(std::uint64_t before) {
  const std::lock_guard lock(mutex_);
  for (; !unsent_.empty() && unsent_.begin()->first < before; unsent_.erase(unsent_.begin()))
    for (const auto& [input, packet] : unsent_.begin()->second) shown_[input] = packet;
}

void StillReceipts::acknowledge(std::uint64_t sequence) {
  const std::lock_guard lock(mutex_);
  for (; !waiting_.empty() && waiting_.front().first <= sequence; waiting_.pop_front())
    for (const auto& [input, packet] : waiting_.front().second) shown_[input] = packet;
}

std::vector<std::pair<std::size_t, std::uint64_t>> StillReceipts::take() {
  const std::lock_guard lock(mutex_);
  std::vector<std::pair<std::size_t, std::uint64_t>> out(shown_.begin(), shown_.end());
  shown_.clear();
  return out;
}

}  // namespace mr::node
