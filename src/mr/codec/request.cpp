#include "mr/codec/request.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <string>

#include "mr/codec/seal.h"
#include "mr/core/assert.h"

namespace mr::codec {
namespace {

constexpr char kMagic[] = {'M', 'R', 'W', '3'};
constexpr char kTimeMagic[] = {'M', 'R', 'T', '3'};
constexpr std::uint32_t kWholeHead = 1, kTaken = 2, kShown = 4, kTime = 8;
constexpr std::size_t kHeadBytes = 16, kKeyBytes = 28, kStreamBytes = 4;

template <typename Integer>
void put_integer(std::vector<std::byte>& out, Integer value) {
  for (std::size_t i = 0; i < sizeof value; ++i)
    out.push_back(static_cast<std::byte>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xFF));
}

template <typename Integer>
Integer get(std::span<const std::byte>& in) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < sizeof(Integer); ++i)
    value |= static_cast<std::uint64_t>(in[i]) << (8 * i);
  in = in.subspan(sizeof(Integer));
  return static_cast<Integer>(value);
}

Error wrong(Error::Cause cause, const char* what) {
  return {cause, std::string("request: ") + what};
}

bool is_sorted_and_unique(const std::vector<std::uint32_t>& streams) {
  return std::adjacent_find(streams.begin(), streams.end(), std::greater_equal<>()) ==
         streams.end();
}

}  // namespace

bool Request::wants_key_frame(std::uint32_t stream) const {
  return std::binary_search(key_frames.begin(), key_frames.end(), stream);
}

std::vector<std::byte> encode_request(const Request& request) {
  MR_ASSERT(request.chunks.size() <= Request::kMaxChunks);
  MR_ASSERT(request.key_frames.size() <= Request::kMaxStreams);
  MR_ASSERT(is_sorted_and_unique(request.key_frames));
  std::vector<std::byte> out;
  for (const char c : kMagic) out.push_back(static_cast<std::byte>(c));
  put_integer(out, (request.whole_head ? kWholeHead : 0) | (request.taken ? kTaken : 0) |
                       (request.shown ? kShown : 0) | (request.time ? kTime : 0));
  put_integer(out, static_cast<std::uint32_t>(request.chunks.size()));
  put_integer(out, static_cast<std::uint32_t>(request.key_frames.size()));
  for (const ChunkKey& k : request.chunks) {
    for (const std::int32_t v : {k.id.cube.x, k.id.cube.y, k.id.cube.z}) put_integer(out, v);
    for (const std::uint32_t v :
         {k.id.source, static_cast<std::uint32_t>(k.id.layer), k.level, k.version})
      put_integer(out, v);
  }
  for (const std::uint32_t stream : request.key_frames) put_integer(out, stream);
  for (const auto& sequence : {request.taken, request.shown})
    if (sequence) put_integer(out, *sequence);
  seal(out);
  return out;
}

Result<Request> decode_request(std::span<const std::byte> sealed) {
  const auto unsealed = unseal(sealed);
  const std::span<const std::byte> bytes = unsealed ? *unsealed : sealed;
  if (bytes.size() < kHeadBytes || std::memcmp(bytes.data(), kMagic, sizeof kMagic) != 0)
    return wrong(Error::Cause::corrupt, "not one of ours, or of another version");
  if (!unsealed) return wrong(Error::Cause::corrupt, unsealed.error().message.c_str());
  auto in = bytes.subspan(sizeof kMagic);
  const auto flags = get<std::uint32_t>(in), chunks = get<std::uint32_t>(in),
             streams = get<std::uint32_t>(in);
  if (chunks > Request::kMaxChunks) return wrong(Error::Cause::too_large, "too many chunks");
  if (streams > Request::kMaxStreams) return wrong(Error::Cause::too_large, "too many streams");
  if (flags & ~(kWholeHead | kTaken | kShown | kTime))
    return wrong(Error::Cause::corrupt, "unknown flags");
  const std::size_t sequences = (flags & kTaken ? 1 : 0) + (flags & kShown ? 1 : 0);
  if (in.size() != chunks * kKeyBytes + streams * kStreamBytes + sequences * sizeof(std::uint64_t))
    return wrong(Error::Cause::corrupt, "its length is not as it says");
  Request out;
  out.whole_head = (flags & kWholeHead) != 0;
  out.time = (flags & kTime) != 0;
  for (std::uint32_t i = 0; i < chunks; ++i) {
    ChunkKey& k = out.chunks.emplace_back();
    for (std::int32_t* v : {&k.id.cube.x, &k.id.cube.y, &k.id.cube.z}) *v = get<std::int32_t>(in);
    k.id.source = get<std::uint32_t>(in);
    const auto layer = get<std::uint32_t>(in);
    if (layer > static_cast<std::uint32_t>(Layer::still))
      return wrong(Error::Cause::corrupt, "an unknown layer");
    k.id.layer = static_cast<Layer>(layer);
    for (std::uint32_t* v : {&k.level, &k.version}) *v = get<std::uint32_t>(in);
  }
  for (std::uint32_t i = 0; i < streams; ++i) out.key_frames.push_back(get<std::uint32_t>(in));
  if (!is_sorted_and_unique(out.key_frames))
    return wrong(Error::Cause::corrupt, "unsorted streams");
  if (flags & kTaken) out.taken = get<std::uint64_t>(in);
  if (flags & kShown) out.shown = get<std::uint64_t>(in);
  return out;
}

std::vector<std::byte> encode_time(TimePoint now) {
  std::vector<std::byte> out;
  for (const char c : kTimeMagic) out.push_back(static_cast<std::byte>(c));
  put_integer(out, static_cast<std::int64_t>(now.time_since_epoch().count()));
  seal(out);
  return out;
}

std::optional<Result<TimePoint>> decode_time(std::span<const std::byte> bytes) {
  if (bytes.size() < sizeof kTimeMagic ||
      std::memcmp(bytes.data(), kTimeMagic, sizeof kTimeMagic) != 0)
    return std::nullopt;
  const auto unsealed = unseal(bytes);
  if (!unsealed || unsealed->size() != sizeof kTimeMagic + sizeof(std::int64_t))
    return Error{Error::Cause::corrupt, "answer: a time that was damaged"};
  auto in = unsealed->subspan(sizeof kTimeMagic);
  const auto ns = get<std::int64_t>(in);
  // Sums and differences of times must not overflow.
  constexpr std::int64_t kCenturies = std::int64_t{1} << 61;
  if (ns < -kCenturies || ns > kCenturies)
    return Error{Error::Cause::corrupt, "answer: a time out of range"};
  return TimePoint(Duration(ns));
}

}  // namespace mr::codec
