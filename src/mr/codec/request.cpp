#include "mr/codec/request.h"

#include <cstring>
#include <string>

#include "mr/core/assert.h"

namespace mr::codec {
namespace {

constexpr char kMagic[] = {'M', 'R', 'W', 'T'};
constexpr std::uint32_t kKeyFrame = 1, kTaken = 2;
constexpr std::size_t kHeadBytes = 12, kKeyBytes = 24;

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

}  // namespace

std::vector<std::byte> encode_request(const Request& request) {
  MR_ASSERT(request.chunks.size() <= Request::kMaxChunks);
  std::vector<std::byte> out;
  for (const char c : kMagic) out.push_back(static_cast<std::byte>(c));
  put_integer(out, (request.key_frame ? kKeyFrame : 0) | (request.taken ? kTaken : 0));
  put_integer(out, static_cast<std::uint32_t>(request.chunks.size()));
  for (const ChunkKey& k : request.chunks) {
    for (const std::int32_t v : {k.id.cube.x, k.id.cube.y, k.id.cube.z}) put_integer(out, v);
    for (const std::uint32_t v : {k.id.source, k.level, k.version}) put_integer(out, v);
  }
  if (request.taken) put_integer(out, *request.taken);
  return out;
}

Result<Request> decode_request(std::span<const std::byte> bytes) {
  if (bytes.size() < kHeadBytes || std::memcmp(bytes.data(), kMagic, sizeof kMagic) != 0)
    return wrong(Error::Cause::corrupt, "not one of ours");
  auto in = bytes.subspan(sizeof kMagic);
  const auto flags = get<std::uint32_t>(in), count = get<std::uint32_t>(in);
  if (count > Request::kMaxChunks) return wrong(Error::Cause::too_large, "too many chunks");
  if (flags & ~(kKeyFrame | kTaken)) return wrong(Error::Cause::corrupt, "unknown flags");
  if (in.size() != count * kKeyBytes + (flags & kTaken ? sizeof(std::uint64_t) : 0))
    return wrong(Error::Cause::corrupt, "its length is not as it says");
  Request out;
  out.key_frame = (flags & kKeyFrame) != 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    ChunkKey& k = out.chunks.emplace_back();
    for (std::int32_t* v : {&k.id.cube.x, &k.id.cube.y, &k.id.cube.z}) *v = get<std::int32_t>(in);
    for (std::uint32_t* v : {&k.id.source, &k.level, &k.version}) *v = get<std::uint32_t>(in);
  }
  if (flags & kTaken) out.taken = get<std::uint64_t>(in);
  return out;
}

}  // namespace mr::codec
