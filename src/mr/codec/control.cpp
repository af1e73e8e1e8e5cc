#include "mr/codec/control.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <string>

#include "mr/codec/seal.h"
#include "mr/core/assert.h"

namespace mr::codec {
namespace {

constexpr std::size_t kMagicBytes = 4;
using Magic = char[kMagicBytes + 1];
constexpr Magic kControlMagic = "MRCT", kTimeMagic = "MRT3", kRefusalMagic = "MRNO";

/// After the version follow sections in ascending order of kind: kind, length of the body, body. An
/// unknown kind is skipped, so that requests can be added that older nodes ignore.
enum class Section : std::uint32_t {
  key_frames = 1,
  chunks = 2,
  taken = 3,
  whole_head = 4,
  shown = 5,
  time = 6,
  plan = 8,  // 7: plans without those of single sensors, of earlier programs
  target = 9
};

constexpr std::size_t kKeyBytes = 28, kStreamBytes = 4, kSequenceBytes = 8;
constexpr std::size_t kPlanBytes = 5 * 8 + 3 * 4;  // of one node
constexpr std::size_t kSensorPlanBytes = 4 + kPlanBytes;

template <typename Integer>
void put_integer(std::vector<std::byte>& out, Integer value) {
  for (std::size_t i = 0; i < sizeof value; ++i)
    out.push_back(static_cast<std::byte>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xFF));
}
void put_number(std::vector<std::byte>& out, double value) {
  put_integer(out, std::bit_cast<std::uint64_t>(value));
}

template <typename Integer>
Integer get(std::span<const std::byte>& in) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < sizeof(Integer); ++i)
    value |= static_cast<std::uint64_t>(in[i]) << (8 * i);
  in = in.subspan(sizeof(Integer));
  return static_cast<Integer>(value);
}
double get_number(std::span<const std::byte>& in) {
  return std::bit_cast<double>(get<std::uint64_t>(in));
}

std::vector<std::byte> begin_message(const Magic& magic) {
  const auto bytes = std::as_bytes(std::span(magic)).first(kMagicBytes);
  return {bytes.begin(), bytes.end()};
}
bool is_message(std::span<const std::byte> bytes, const Magic& magic) {
  return bytes.size() >= kMagicBytes && std::memcmp(bytes.data(), magic, kMagicBytes) == 0;
}

Error wrong(Error::Cause cause, const std::string& what) { return {cause, "control: " + what}; }

bool is_sorted_and_unique(const std::vector<StreamId>& streams) {
  return std::adjacent_find(streams.begin(), streams.end(), std::greater_equal<>()) ==
         streams.end();
}

void put_section(std::vector<std::byte>& out, Section kind, std::size_t bytes) {
  put_integer(out, static_cast<std::uint32_t>(kind));
  put_integer(out, static_cast<std::uint32_t>(bytes));
}

void put_key(std::vector<std::byte>& out, const ChunkKey& k) {
  for (const std::int32_t v : {k.id.cube.x, k.id.cube.y, k.id.cube.z}) put_integer(out, v);
  for (const std::uint32_t v :
       {number_of(k.id.source), static_cast<std::uint32_t>(k.id.layer), k.level, k.version})
    put_integer(out, v);
}

void put_plan(std::vector<std::byte>& out, const CodingPlan& p) {
  for (const double v :
       {p.decimation.ratio, p.decimation.error_m, p.still_error_m, p.texture_scale, p.plate_scale})
    put_number(out, v);
  for (const std::int32_t v : {p.mesh_speed, p.texture_qp, p.plate_qp}) put_integer(out, v);
}

CodingPlan get_plan(std::span<const std::byte>& in) {
  CodingPlan p;
  for (double* v : {&p.decimation.ratio, &p.decimation.error_m, &p.still_error_m, &p.texture_scale,
                    &p.plate_scale})
    *v = get_number(in);
  for (int* v : {&p.mesh_speed, &p.texture_qp, &p.plate_qp}) *v = get<std::int32_t>(in);
  return p;
}

Status read_streams(std::span<const std::byte> body, Control& out) {
  if (body.size() / kStreamBytes > Control::kMaxStreams)
    return wrong(Error::Cause::too_large, "too many streams");
  if (body.size() % kStreamBytes != 0 || body.empty())
    return wrong(Error::Cause::corrupt, "streams of another length");
  while (!body.empty()) out.key_frames.push_back(StreamId{get<std::uint32_t>(body)});
  if (!is_sorted_and_unique(out.key_frames))
    return wrong(Error::Cause::corrupt, "unsorted streams");
  return {};
}

Status read_chunks(std::span<const std::byte> body, Control& out) {
  if (body.size() / kKeyBytes > Control::kMaxChunks)
    return wrong(Error::Cause::too_large, "too many chunks");
  if (body.size() % kKeyBytes != 0 || body.empty())
    return wrong(Error::Cause::corrupt, "chunk keys of another length");
  while (!body.empty()) {
    ChunkKey& k = out.chunks.emplace_back();
    for (std::int32_t* v : {&k.id.cube.x, &k.id.cube.y, &k.id.cube.z}) *v = get<std::int32_t>(body);
    k.id.source = SensorId{get<std::uint32_t>(body)};
    const auto layer = get<std::uint32_t>(body);
    if (layer > static_cast<std::uint32_t>(Layer::still))
      return wrong(Error::Cause::corrupt, "an unknown layer");
    k.id.layer = static_cast<Layer>(layer);
    for (std::uint32_t* v : {&k.level, &k.version}) *v = get<std::uint32_t>(body);
  }
  return {};
}

Status read_sequence(std::span<const std::byte> body, std::optional<std::uint64_t>& out) {
  if (body.size() != kSequenceBytes)
    return wrong(Error::Cause::corrupt, "a sequence of another length");
  out = get<std::uint64_t>(body);
  return {};
}

Status read_flag(std::span<const std::byte> body, bool& out) {
  if (!body.empty()) return wrong(Error::Cause::corrupt, "a flag with a body");
  out = true;
  return {};
}

Status read_plans(std::span<const std::byte> body, Control& out) {
  if (body.size() < 2 * kPlanBytes || (body.size() - 2 * kPlanBytes) % kSensorPlanBytes != 0)
    return wrong(Error::Cause::corrupt, "a plan of another length");
  if ((body.size() - 2 * kPlanBytes) / kSensorPlanBytes > ScenePlan::kMaxSensors)
    return wrong(Error::Cause::too_large, "plans for too many sensors");
  ScenePlan& plan = out.plan.emplace();
  plan.sensors = get_plan(body);
  plan.root = get_plan(body);
  while (!body.empty()) {
    const SensorId sensor{get<std::uint32_t>(body)};
    if (!plan.by_sensor.empty() && plan.by_sensor.rbegin()->first >= sensor)
      return wrong(Error::Cause::corrupt, "unsorted plans of sensors");
    plan.by_sensor.emplace_hint(plan.by_sensor.end(), sensor, get_plan(body));
  }
  if (const auto problems = plan.problems(); !problems.empty())
    return wrong(Error::Cause::corrupt, "a plan whose " + problems.front());
  return {};
}

Status read_target(std::span<const std::byte> body, Control& out) {
  if (body.size() != sizeof(double))
    return wrong(Error::Cause::corrupt, "a target of another length");
  out.target_mbps = get_number(body);
  if (!std::isfinite(*out.target_mbps) || *out.target_mbps <= 0)
    return wrong(Error::Cause::corrupt, "a target that is no rate");
  return {};
}

Status read_section(Section kind, std::span<const std::byte> body, Control& out) {
  switch (kind) {
    case Section::key_frames:
      return read_streams(body, out);
    case Section::chunks:
      return read_chunks(body, out);
    case Section::taken:
      return read_sequence(body, out.taken);
    case Section::whole_head:
      return read_flag(body, out.whole_head);
    case Section::shown:
      return read_sequence(body, out.shown);
    case Section::time:
      return read_flag(body, out.time);
    case Section::plan:
      return read_plans(body, out);
    case Section::target:
      return read_target(body, out);
  }
  return {};  // unknown kind, of a newer version: skipped
}

}  // namespace

bool Control::wants_key_frame(StreamId stream) const {
  return std::binary_search(key_frames.begin(), key_frames.end(), stream);
}

Result<Control> plan_control(const ScenePlan& plan) {
  if (const auto problems = plan.problems(); !problems.empty())
    return Error{Error::Cause::invalid, "plan: " + problems.front()};
  Control out;
  out.plan = plan;
  return out;
}

std::vector<std::byte> encode_control(const Control& control) {
  MR_ASSERT(control.chunks.size() <= Control::kMaxChunks);
  MR_ASSERT(control.key_frames.size() <= Control::kMaxStreams);
  MR_ASSERT(is_sorted_and_unique(control.key_frames));
  std::vector<std::byte> out = begin_message(kControlMagic);
  put_integer(out, Control::kVersion);
  if (!control.key_frames.empty())
    put_section(out, Section::key_frames, control.key_frames.size() * kStreamBytes);
  for (const StreamId stream : control.key_frames) put_integer(out, number_of(stream));
  if (!control.chunks.empty()) put_section(out, Section::chunks, control.chunks.size() * kKeyBytes);
  for (const ChunkKey& key : control.chunks) put_key(out, key);
  if (control.taken) {
    put_section(out, Section::taken, kSequenceBytes);
    put_integer(out, *control.taken);
  }
  if (control.whole_head) put_section(out, Section::whole_head, 0);
  if (control.shown) {
    put_section(out, Section::shown, kSequenceBytes);
    put_integer(out, *control.shown);
  }
  if (control.time) put_section(out, Section::time, 0);
  if (control.plan) {
    put_section(out, Section::plan,
                2 * kPlanBytes + control.plan->by_sensor.size() * kSensorPlanBytes);
    put_plan(out, control.plan->sensors);
    put_plan(out, control.plan->root);
    for (const auto& [sensor, plan] : control.plan->by_sensor) {
      put_integer(out, number_of(sensor));
      put_plan(out, plan);
    }
  }
  if (control.target_mbps) {
    put_section(out, Section::target, sizeof(double));
    put_number(out, *control.target_mbps);
  }
  seal(out);
  return out;
}

Result<Control> decode_control(std::span<const std::byte> sealed) {
  if (!is_message(sealed, kControlMagic))
    return wrong(Error::Cause::corrupt, "not one of ours, or of before version 1");
  const auto unsealed = unseal(sealed);
  if (!unsealed) return wrong(Error::Cause::corrupt, unsealed.error().message);
  std::span<const std::byte> in = unsealed->subspan(kMagicBytes);
  if (in.size() < sizeof(std::uint32_t)) return wrong(Error::Cause::corrupt, "too short");
  if (const auto version = get<std::uint32_t>(in); version != Control::kVersion)
    return wrong(Error::Cause::unsupported, "a message of version " + std::to_string(version) +
                                                "; this program reads version " +
                                                std::to_string(Control::kVersion));
  Control out;
  std::uint32_t last = 0;
  while (!in.empty()) {
    if (in.size() < 2 * sizeof(std::uint32_t)) return wrong(Error::Cause::corrupt, "too short");
    const auto kind = get<std::uint32_t>(in), bytes = get<std::uint32_t>(in);
    if (kind <= last) return wrong(Error::Cause::corrupt, "unsorted sections");
    if (bytes > in.size()) return wrong(Error::Cause::corrupt, "its length is not as it says");
    last = kind;
    if (const Status read = read_section(static_cast<Section>(kind), in.first(bytes), out); !read)
      return read.error();
    in = in.subspan(bytes);
  }
  return out;
}

std::vector<std::byte> encode_time(TimePoint now) {
  std::vector<std::byte> out = begin_message(kTimeMagic);
  put_integer(out, static_cast<std::int64_t>(now.time_since_epoch().count()));
  seal(out);
  return out;
}

std::optional<Result<TimePoint>> decode_time(std::span<const std::byte> bytes) {
  if (!is_message(bytes, kTimeMagic)) return std::nullopt;
  const auto unsealed = unseal(bytes);
  if (!unsealed || unsealed->size() != kMagicBytes + sizeof(std::int64_t))
    return Error{Error::Cause::corrupt, "answer: a time that was damaged"};
  auto in = unsealed->subspan(kMagicBytes);
  const auto ns = get<std::int64_t>(in);
  // Sums and differences of times must not overflow.
  constexpr std::int64_t kCenturies = std::int64_t{1} << 61;
  if (ns < -kCenturies || ns > kCenturies)
    return Error{Error::Cause::corrupt, "answer: a time out of range"};
  return TimePoint(Duration(ns));
}

std::vector<std::byte> encode_refusal(const std::string& why) {
  std::vector<std::byte> out = begin_message(kRefusalMagic);
  for (const char c : why.substr(0, kMostWhy)) out.push_back(static_cast<std::byte>(c));
  seal(out);
  return out;
}

std::optional<Result<std::string>> decode_refusal(std::span<const std::byte> bytes) {
  if (!is_message(bytes, kRefusalMagic)) return std::nullopt;
  const auto unsealed = unseal(bytes);
  if (!unsealed || unsealed->size() > kMagicBytes + kMostWhy)
    return Error{Error::Cause::corrupt, "answer: a refusal that was damaged"};
  std::string why;
  for (const std::byte b : unsealed->subspan(kMagicBytes)) {
    const char c = static_cast<char>(b);
    why.push_back(c >= ' ' && c <= '~' ? c : '?');
  }
  return why;
}

}  // namespace mr::codec
