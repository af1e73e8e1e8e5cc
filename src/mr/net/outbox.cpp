#include "mr/net/outbox.h"

#include <utility>

namespace mr::net {

Outbox::Outbox(Coalesce coalesce, const OutboxLimits& limits)
    : coalesce_(std::move(coalesce)), limits_(limits) {}

bool Outbox::push(Message message) {
  if (!message) return false;
  bool first = false;
  {
    const std::lock_guard lock(mutex_);
    const bool was_empty = waiting_.empty();
    add(std::move(message));
    first = was_empty && !waiting_.empty();
  }
  arrived_.notify_one();
  return first;
}

void Outbox::add(Message message) {
  const std::size_t size = message->size();
  const bool too_many = !coalesce_ && waiting_.size() >= limits_.messages;
  if (too_many || bytes_ + size > limits_.bytes) lose_waiting();
  if (size > limits_.bytes) {
    ++counts_.lost;
    return;
  }
  waiting_.push_back(std::move(message));
  bytes_ += size;
  if (waiting_.size() <= limits_.messages) return;
  // Folds under the lock, so that no newer message can be popped before these.
  if (Message one = fold(take(), counts_)) {
    bytes_ = one->size();
    waiting_.push_back(std::move(one));
  }
}

void Outbox::lose_waiting() { counts_.lost += take().size(); }

std::vector<Message> Outbox::take() {
  bytes_ = 0;
  return std::exchange(waiting_, {});
}

Message Outbox::fold(const std::vector<Message>& messages, Counts& counts) const {
  Message one = coalesce_ ? coalesce_(messages) : nullptr;
  if (one)
    counts.folded += messages.size() - 1;
  else
    counts.lost += messages.size();
  return one;
}

Message Outbox::take_one(std::unique_lock<std::mutex>& lock) {
  if (waiting_.empty()) return nullptr;
  if (waiting_.size() == 1 || !coalesce_) {
    Message oldest = std::move(waiting_.front());
    waiting_.erase(waiting_.begin());
    bytes_ -= oldest->size();
    return oldest;
  }
  const std::vector<Message> messages = take();
  lock.unlock();  // senders need not wait for the fold
  Counts counts;
  Message one = fold(messages, counts);
  lock.lock();
  counts_.folded += counts.folded;
  counts_.lost += counts.lost;
  return one;
}

Message Outbox::try_pop() {
  std::unique_lock lock(mutex_);
  return take_one(lock);
}

Message Outbox::pop(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (arrived_.wait(lock, stop, [&] { return !waiting_.empty(); }) && !stop.stop_requested())
    if (Message one = take_one(lock)) return one;
  return nullptr;
}

bool Outbox::empty() const {
  const std::lock_guard lock(mutex_);
  return waiting_.empty();
}

Outbox::Counts Outbox::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

}  // namespace mr::net
