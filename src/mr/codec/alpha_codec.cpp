#include "mr/codec/alpha_codec.h"

#include <algorithm>
#include <array>
#include <cstdint>

#include "mr/core/assert.h"
#include "mr/core/packet.h"

namespace mr::codec {
namespace {

constexpr int kBlock_px = AlphaPlane::kBlock_px;

// The range coder of LZMA: probabilities of a 0 in 2048ths, carries resolved by the encoder.
constexpr int kProbabilityBits = 11, kAdaptation = 4;
constexpr std::uint32_t kLeastRange = 1u << 24;
using Probability = std::uint16_t;
constexpr Probability kEven = 1 << (kProbabilityBits - 1);

void adapt(Probability& zero, int bit) {
  if (bit)
    zero = static_cast<Probability>(zero - (zero >> kAdaptation));
  else
    zero = static_cast<Probability>(zero + (((1 << kProbabilityBits) - zero) >> kAdaptation));
}

class RangeEncoder {
 public:
  int code(Probability& zero, int bit) {
    const std::uint32_t bound = (range_ >> kProbabilityBits) * zero;
    if (bit)
      low_ += bound, range_ -= bound;
    else
      range_ = bound;
    adapt(zero, bit);
    while (range_ < kLeastRange) range_ <<= 8, shift_low();
    return bit;
  }

  /// The decoder reads zeros beyond the end, so zeros there are left out.
  std::vector<std::byte> finish() {
    for (int i = 0; i < 5; ++i) shift_low();
    out_.erase(out_.begin());  // the first byte is always 0
    while (out_.size() > 1 && out_.back() == std::byte{0}) out_.pop_back();
    return std::move(out_);
  }

 private:
  void put(std::uint32_t byte) { out_.push_back(static_cast<std::byte>(byte & 0xFF)); }

  void shift_low() {
    if (low_ < 0xFF000000u || low_ >> 32) {
      const auto carry = static_cast<std::uint32_t>(low_ >> 32);
      put(cache_ + carry);
      for (; waiting_ > 0; --waiting_) put(0xFF + carry);
      cache_ = static_cast<std::uint32_t>(low_ >> 24) & 0xFF;
    } else {
      ++waiting_;
    }
    low_ = (low_ & 0x00FFFFFFu) << 8;
  }

  std::uint64_t low_ = 0;
  std::uint32_t range_ = 0xFFFFFFFFu, cache_ = 0;
  std::size_t waiting_ = 0;  ///< bytes 0xFF that a carry would change
  std::vector<std::byte> out_;
};

class RangeDecoder {
 public:
  explicit RangeDecoder(std::span<const std::byte> bytes) : bytes_(bytes) {
    for (int i = 0; i < 4; ++i) code_ = code_ << 8 | next();
  }

  int code(Probability& zero, int /*bit*/) {
    const std::uint32_t bound = (range_ >> kProbabilityBits) * zero;
    const int bit = code_ >= bound;
    if (bit)
      code_ -= bound, range_ -= bound;
    else
      range_ = bound;
    adapt(zero, bit);
    while (range_ < kLeastRange) range_ <<= 8, code_ = code_ << 8 | next();
    return bit;
  }

  bool has_read_all() const { return read_ >= bytes_.size(); }

 private:
  std::uint32_t next() {
    const std::size_t i = read_++;
    return i < bytes_.size() ? std::to_integer<std::uint32_t>(bytes_[i]) : 0;
  }

  std::span<const std::byte> bytes_;
  std::size_t read_ = 0;
  std::uint32_t range_ = 0xFFFFFFFFu, code_ = 0;
};

/// Walks over a plane's blocks; the same for both ends. `Coder::code(probability, bit)` returns the
/// bit that was coded: the encoder the given one, the decoder what it reads.
template <typename Coder>
class PlaneCoder {
 public:
  PlaneCoder(Coder& coder, ImageMask& plane)
      : coder_(coder),
        plane_(plane),
        columns_((plane.width + kBlock_px - 1) / kBlock_px),
        above_(columns_, kZeros) {
    mixed_.fill(kEven), ones_.fill(kEven), pixels_.fill(kEven);
  }

  void run() {
    for (int y = 0; y < plane_.height; y += kBlock_px) {
      Kind left = kZeros;
      for (int column = 0; column < columns_; ++column) {
        const Rect block{column * kBlock_px, y,
                         std::min(kBlock_px, plane_.width - column * kBlock_px),
                         std::min(kBlock_px, plane_.height - y)};
        left = above_[column] = code_block(block, 3 * left + above_[column]);
      }
    }
  }

 private:
  enum Kind : std::uint8_t { kZeros, kOnes, kMixed };

  Kind kind_of(const Rect& block) const {
    const std::uint8_t first = *plane_.at(block.x, block.y);
    for (int y = block.y; y < block.y + block.height; ++y)
      for (int x = block.x; x < block.x + block.width; ++x)
        if (*plane_.at(x, y) != first) return kMixed;
    return first ? kOnes : kZeros;
  }

  Kind code_block(const Rect& block, int around) {
    const Kind kind = kind_of(block);  // for the decoder: of what is to be filled in
    if (coder_.code(mixed_[around], kind == kMixed)) {
      for (int y = block.y; y < block.y + block.height; ++y)
        for (int x = block.x; x < block.x + block.width; ++x) {
          std::uint8_t& pixel = *plane_.at(x, y);
          pixel = static_cast<std::uint8_t>(coder_.code(pixels_[context(block, x, y)], pixel));
        }
      return kMixed;
    }
    const int one = coder_.code(ones_[around], kind == kOnes);
    for (int y = block.y; y < block.y + block.height; ++y)
      std::fill_n(plane_.at(block.x, y), block.width, static_cast<std::uint8_t>(one));
    return one ? kOnes : kZeros;
  }

  /// Two pixels before this one, five above, three above these. Those that are not known yet, or
  /// not in the plane, are as the last one before them in their row.
  int context(const Rect& block, int x, int y) const {
    const auto bit = [&](int column, int row) -> int {
      if (row < 0) return 0;
      const int last = row < block.y ? plane_.width - 1 : block.x + block.width - 1;
      return *plane_.at(std::clamp(column, 0, last), row);
    };
    int out = x > 0 ? bit(x - 1, y) << 1 | bit(x - 2, y) : 0;
    for (int dx = -2; dx <= 2; ++dx) out = out << 1 | bit(x + dx, y - 1);
    for (int dx = -1; dx <= 1; ++dx) out = out << 1 | bit(x + dx, y - 2);
    return out;
  }

  Coder& coder_;
  ImageMask& plane_;
  int columns_;
  std::vector<Kind> above_;                  ///< [columns] the blocks above
  std::array<Probability, 9> mixed_, ones_;  ///< by the kinds of the blocks to the left and above
  std::array<Probability, 1 << 10> pixels_;  ///< by the pixels around
};

}  // namespace

std::vector<std::byte> encode_alpha(const ImageMask& plane) {
  MR_ASSERT(!plane.empty());
  ImageMask copy = plane;
  RangeEncoder coder;
  PlaneCoder<RangeEncoder>(coder, copy).run();
  return coder.finish();
}

Result<ImageMask> decode_alpha(std::span<const std::byte> bytes, int width, int height) {
  MR_ASSERT(width > 0 && height > 0);
  ImageMask out(width, height);
  RangeDecoder coder(bytes);
  PlaneCoder<RangeDecoder>(coder, out).run();
  if (!coder.has_read_all())
    return Error{Error::Cause::invalid, "alpha plane: more bytes than it has use for"};
  return out;
}

}  // namespace mr::codec
