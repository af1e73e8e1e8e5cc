#include "mr/codec/packet_order.h"

#include <string>

namespace mr::codec {

std::optional<Error> PacketOrder::objection(std::uint32_t epoch, std::uint64_t sequence) const {
  const auto refuse = [](const std::string& why) { return Error{Error::Cause::invalid, why}; };
  if (epoch != last_->epoch) {
    // Epochs are times modulo 2^32: serial number arithmetic.
    const bool is_newer = static_cast<std::int32_t>(epoch - last_->epoch) > 0;
    if (is_newer) return std::nullopt;
    return refuse(
        "is of an older start of the node than the one before; does it run twice, or are its "
        "packets sent again?");
  }
  const std::string numbers = "packet " + std::to_string(sequence) + " comes after packet " +
                              std::to_string(last_->sequence);
  if (sequence <= last_->sequence) return refuse(numbers);
  if (sequence - last_->sequence > kMostAhead) return refuse(numbers + ", too far ahead");
  return std::nullopt;
}

Result<PacketOrder::Verdict> PacketOrder::take(std::uint32_t epoch, std::uint64_t sequence,
                                               TimePoint now) {
  Verdict verdict = Verdict::next;
  if (!last_ || last_->epoch != epoch) verdict = Verdict::afresh;
  if (last_)
    if (const auto why = objection(epoch, sequence)) {
      const bool was_set_back = now < last_->at;
      const bool is_silent = was_set_back || now - last_->at >= kPatience;
      if (refused_ < kRefusals || !is_silent) {
        ++refused_;
        return *why;
      }
      verdict = Verdict::afresh;
    }
  last_ = {epoch, sequence, now};
  refused_ = 0;
  return verdict;
}

}  // namespace mr::codec
