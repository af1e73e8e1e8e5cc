// The TCP transport's frames and the NATS transport's fragments on any bytes, cut anywhere: no
// crash, nothing above the caps, and the same result for any cut.
#include <algorithm>
#include <cstdlib>

#include "mr/net/fragments.h"
#include "mr/net/frames.h"
#include "mr/net/static_files.h"
#include "patched.h"

namespace {

using namespace mr::net;

constexpr std::size_t kCap = 4096;

struct Outcome {
  std::vector<Frame> frames;
  bool broken = false;
};

Outcome read_frames(std::span<const std::byte> bytes, std::size_t step) {
  FrameReader reader(
      {{FrameKind::packet, kCap}, {FrameKind::request, 64}, {FrameKind::subscribe, 0}});
  Outcome out;
  while (!bytes.empty() && !out.broken) {
    auto frames = reader.feed(bytes.first(std::min(step, bytes.size())));
    bytes = bytes.subspan(std::min(step, bytes.size()));
    out.broken = !frames;
    if (frames)
      for (Frame& frame : *frames) out.frames.push_back(std::move(frame));
  }
  return out;
}

void check_frames(std::span<const std::byte> bytes) {
  const Outcome single = read_frames(bytes, 1), cut = read_frames(bytes, 7);
  if (single.broken != cut.broken || single.frames.size() < cut.frames.size()) std::abort();
  for (std::size_t i = 0; i < cut.frames.size(); ++i)
    if (single.frames[i].payload != cut.frames[i].payload) std::abort();
  for (const Frame& frame : single.frames)
    if (frame.payload.size() > kCap) std::abort();
}

/// The first byte of each piece is its length, so that the fuzzer may shape several parts.
void check_fragments(std::span<const std::byte> bytes) {
  Reassembly reassembly({.message_bytes = 256, .messages = 4, .bytes = 512});
  Reassembly::TimePoint now{};
  while (!bytes.empty()) {
    const std::size_t size =
        std::min<std::size_t>(std::to_integer<std::size_t>(bytes[0]), bytes.size() - 1);
    const Message whole = reassembly.accept(now, bytes.subspan(1, size));
    if (whole && whole->size() > 256) std::abort();
    bytes = bytes.subspan(1 + size);
    now += std::chrono::milliseconds(100);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = mr::fuzz::as_bytes(data, size);
  check_frames(bytes);
  check_fragments(bytes);
  const auto path = target_path({reinterpret_cast<const char*>(data), size});
  if (path && (!path->starts_with('/') || path->find('\0') != std::string::npos)) std::abort();
  return 0;
}
