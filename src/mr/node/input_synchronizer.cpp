#include "mr/node/input_synchronizer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>

#include "mr/codec/packet_codec.h"
#include "mr/node/node_clock.h"

namespace mr::node {
namespace {

/// Units that wait in vain are given up; the streams then start again with a key frame.
constexpr std::size_t kMaxUnitsWaiting = 64;  // per sensor

Duration milliseconds(double ms) {
  return std::chrono::round<Duration>(std::chrono::duration<double, std::milli>(ms));
}

/// The sensors below each node: of a sensor, itself.
std::map<std::string, std::set<SensorId>> sensors_below(const Scene& scene) {
  std::map<std::string, std::set<SensorId>> out;
  for (const SensorId id : all_sensors(scene.sensors)) out[scene.sensor(id).id].insert(id);
  for (const MergerConfig& merger : scene.mergers)  // children first
    for (const std::string& input : merger.inputs)
      out[merger.id].insert(out[input].begin(), out[input].end());
  return out;
}

/// Whether a cube lies in a region that is `margin` cubes larger on every side.
bool in_region(Vec3i cube, const Box3d& region, double chunk_m, int margin) {
  for (int axis = 0; axis < 3; ++axis) {
    const double low = std::round(region.low[axis] / chunk_m) - margin;
    const double high = std::round(region.high[axis] / chunk_m) + margin;
    if (cube[axis] < low || cube[axis] >= high) return false;
  }
  return true;
}

void keep_latest(std::map<std::string, TimePoint>& marks, const std::string& stage, TimePoint at) {
  constexpr std::size_t kMost = codec::PacketLimits{}.marks / 2;  // room for those of mergers above
  if (marks.size() >= kMost && !marks.contains(stage)) return;
  TimePoint& latest = marks[stage];
  latest = std::max(latest, at);
}

void move_times(Packet& packet, Duration by) {
  packet.captured_at += by;
  for (SourceInfo& source : packet.sources) source.captured_at += by;
  for (TimeMark& mark : packet.marks) mark.at += by;
}

/// Sorts by a key and keeps the first of those that have the same.
template <typename T, typename Key>
void keep_first_of_each(std::vector<T>& items, Key key) {
  std::stable_sort(items.begin(), items.end(),
                   [&](const T& a, const T& b) { return key(a) < key(b); });
  items.erase(std::unique(items.begin(), items.end(),
                          [&](const T& a, const T& b) { return key(a) == key(b); }),
              items.end());
}

}  // namespace

Mesh inside(const Mesh& mesh, const Box3d& region, double chunk_m) {
  std::vector<std::uint8_t> keep(mesh.triangles.size());
  for (std::size_t t = 0; t < keep.size(); ++t) {
    const Vec3f p = mesh.centroid(t);
    const auto cell = [&](float v) { return static_cast<std::int32_t>(std::floor(v / chunk_m)); };
    keep[t] = in_region({cell(p.x), cell(p.y), cell(p.z)}, region, chunk_m, 0);
  }
  return select_triangles(mesh, keep);
}

InputSynchronizer::InputSynchronizer(const Scene& scene, const MergerConfig& merger, bool hand_on)
    : scene_(&scene),
      merger_(merger),
      hand_on_(hand_on),
      aligner_(merger.inputs.size(), milliseconds(1000 / scene.fps),
               milliseconds(merger.deadline_ms)) {
  const auto below = sensors_below(scene);
  for (const std::string& input : merger.inputs) {
    const auto sensors = below.find(input);
    inputs_.emplace_back(scene, input,
                         sensors == below.end() ? std::set<SensorId>{} : sensors->second);
  }
}

AlphaByStream alpha_of(const CaptureSet& captures) {
  AlphaByStream out;
  for (const DecodedScene& scene : captures.scenes)
    out.insert(scene.alpha.begin(), scene.alpha.end());
  return out;
}

/// The packet must come from the node that the input stands for, and speak for its sensors only:
/// another's ids would collide with those of other inputs. Only roots add views of plates (layer
/// `still`), to viewers' packets: here each view is one camera, and has one size.
Status InputSynchronizer::check_sender(const Input& input, const Packet& packet) const {
  const auto refuse = [](const std::string& why) { return Error{Error::Cause::invalid, why}; };
  if (packet.scene != scene_->id || packet.node != input.id)
    return refuse("is of node '" + packet.node + "' of scene '" + packet.scene + "'");
  const auto is_below = [&](auto id) { return input.sensors.contains(SensorId{number_of(id)}); };
  const auto name = [](auto id) { return std::to_string(number_of(id)); };
  for (const View& view : packet.views)
    if (!is_below(view.id))
      return refuse("brings view " + name(view.id) + ", which is not below it");
  for (const View& view : packet.views)
    if (view.layer != Layer::moving)
      return refuse("brings view " + name(view.id) + " of a plate, which only a root has");
  for (const SourceInfo& source : packet.sources)
    if (!is_below(source.sensor))
      return refuse("brings sensor " + name(source.sensor) + ", which is not below it");
  for (const View& view : packet.views)
    if (!is_below(view.stream))
      return refuse("shows stream " + name(view.stream) + ", which is not below it");
  for (const TextureUnit& unit : packet.textures)
    if (!is_below(unit.stream))
      return refuse("brings stream " + name(unit.stream) + ", which is not below it");
  for (const AlphaPlane& plane : packet.alpha)
    if (!is_below(plane.stream))
      return refuse("brings alpha of stream " + name(plane.stream) + ", which is not below it");
  for (const FrameFeatures& features : packet.features)
    if (!is_below(features.sensor))
      return refuse("describes sensor " + name(features.sensor) + ", which is not below it");
  for (const EncodedChunk& chunk : packet.chunks)
    for (const SensorId sensor : chunk.sensors)
      if (!is_below(sensor))
        return refuse("labels a chunk with sensor " + name(sensor) + ", which is not below it");
  if (packet.sources.empty()) return refuse("names no sensor");
  if (input.stream.decoded().is_stale(packet)) return refuse("comes after a newer one");
  return {};
}

Status InputSynchronizer::receive(std::size_t input, std::span<const std::byte> bytes,
                                  TimePoint now) {
  Input& from = inputs_[input];
  auto packet = from.stream.read(bytes, now);
  if (packet) {
    move_times(*packet, -from.clock_ahead);
    if (from.stream.began_afresh()) from.units.clear();  // what is whole is shown until more is
    return receive(input, *std::move(packet), now);
  }
  return drop(from, packet.error());
}

Error InputSynchronizer::drop(const Input& from, const Error& why) {
  Error error{why.cause, "packet from '" + from.id + "' to '" + merger_.id + "': " + why.message};
  drops_.count(link(from), error);
  return error;
}

Status InputSynchronizer::receive(std::size_t input, Packet packet, TimePoint now) {
  const Stopwatch stopwatch(decode_ms_);
  Input& from = inputs_[input];
  if (const Status fits = check_sender(from, packet); !fits) return drop(from, fits.error());
  keep_region(packet);
  from.streams.clear();
  for (const View& view : packet.views) from.streams.insert(view.stream);
  for (const Error& error : from.stream.accept(packet)) drops_.count(link(from), error);
  if (!packet.features.empty()) from.features = std::move(packet.features);
  from.marks.clear();
  for (const TimeMark& mark : packet.marks) keep_latest(from.marks, mark.stage, mark.at);
  if (hand_on_) {
    from.alpha = std::move(packet.alpha);
    keep_units(from, packet);
  }
  settle(input, now);
  return {};
}

/// Leaves out the chunks that are others' to merge; they are not decoded, or asked for.
void InputSynchronizer::keep_region(Packet& packet) const {
  if (!merger_.region) return;
  constexpr int kMargin = 1;  // cubes
  const auto is_far = [&](const ChunkKey& key) {
    return !in_region(key.id.cube, *merger_.region, scene_->fusion.chunk_m, kMargin);
  };
  std::erase_if(packet.manifest, is_far);
  std::erase_if(packet.chunks, [&](const EncodedChunk& chunk) { return is_far(chunk.key); });
}

void InputSynchronizer::keep_units(Input& input, Packet& packet) {
  for (TextureUnit& unit : packet.textures)
    input.units.push_back({packet.captured_at, std::move(unit)});
  const std::size_t most = std::min(kMaxUnitsWaiting * input.sensors.size(),
                                    codec::PacketLimits{}.textures / inputs_.size());
  if (input.units.size() <= most) return;
  for (const Unit& lost : input.units) input.stream.want_key_frame(lost.unit.stream);
  input.units.clear();
}

void InputSynchronizer::take_answer(std::size_t input, std::span<const std::byte> answer,
                                    TimePoint now) {
  const Stopwatch stopwatch(decode_ms_);
  Input& from = inputs_[input];
  for (const Error& error : from.stream.take_answer(answer)) drops_.count(link(from), error);
  settle(input, now);
}

std::optional<TimePoint> InputSynchronizer::newest(std::size_t input) const {
  const auto& whole = inputs_[input].whole;
  return whole ? std::optional(whole->captured_at) : std::nullopt;
}

std::optional<TimePoint> InputSynchronizer::sent_at(std::size_t input) const {
  std::optional<TimePoint> out;
  for (const auto& [stage, at] : inputs_[input].marks) out = std::max(out.value_or(at), at);
  return out;
}

/// If the input's newest capture is complete, it is what is merged from now on.
void InputSynchronizer::settle(std::size_t input, TimePoint now) {
  Input& from = inputs_[input];
  auto scene = from.stream.decoded().scene();
  if (!scene) return;
  from.whole = *std::move(scene), from.whole_alpha = from.alpha;
  from.taken = from.stream.decoded().newest_sequence();
  aligner_.arrived(input, from.whole->captured_at, now);
}

std::vector<std::pair<std::size_t, codec::Control>> InputSynchronizer::requests(TimePoint now) {
  std::vector<std::pair<std::size_t, codec::Control>> out;
  for (std::size_t i = 0; i < inputs_.size(); ++i)
    if (auto request = inputs_[i].stream.wanted(now); !request.empty())
      out.emplace_back(i, std::move(request));
  return out;
}

void InputSynchronizer::ask_key_frames() {
  for (Input& input : inputs_)
    for (const StreamId stream : input.streams) input.stream.want_key_frame(stream);
}

void InputSynchronizer::ask_key_frames(std::span<const StreamId> streams) {
  for (Input& input : inputs_)
    for (const StreamId stream : streams)
      if (input.streams.contains(stream)) input.stream.want_key_frame(stream);
}

Result<std::optional<CaptureSet>> InputSynchronizer::next_set(TimePoint now) {
  const auto tick = aligner_.ready(now);
  if (!tick) return std::optional<CaptureSet>();
  aligner_.merged(*tick, now);
  trace_.add("decode", std::exchange(decode_ms_, 0));
  CaptureSet out;
  out.tick = *tick;
  for (const std::size_t i : aligner_.live_at(*tick)) add(i, out);
  // Also what came too late was taken, else its sender would wait for word.
  for (std::size_t i = 0; i < inputs_.size(); ++i)
    if (inputs_[i].taken) out.taken.emplace_back(i, *std::exchange(inputs_[i].taken, std::nullopt));
  if (out.scenes.empty())
    return Error{Error::Cause::empty, "merger '" + merger_.id + "' has no live input at this tick"};
  keep_first_of_each(out.views, [](const View& view) { return std::pair(view.id, view.layer); });
  keep_first_of_each(out.sources, [](const SourceInfo& source) { return source.sensor; });
  keep_first_of_each(out.features, [](const FrameFeatures& f) { return f.sensor; });
  keep_first_of_each(out.alpha, [](const AlphaPlane& plane) { return plane.stream; });
  return std::optional(std::move(out));
}

/// Adds an input's newest whole capture, with the texture units up to it.
void InputSynchronizer::add(std::size_t input, CaptureSet& out) {
  const Input& from = inputs_[input];
  const DecodedScene& scene = *from.whole;
  std::set<StreamId> given;  // by an input before
  for (const View& view : out.views) given.insert(view.stream);
  out.views.insert(out.views.end(), scene.views.begin(), scene.views.end());
  out.sources.insert(out.sources.end(), scene.sources.begin(), scene.sources.end());
  out.scenes.push_back(scene);
  for (const auto& [stage, at] : from.marks) keep_latest(out.marks, stage, at);
  out.features.insert(out.features.end(), from.features.begin(), from.features.end());
  for (const AlphaPlane& plane : from.whole_alpha)
    if (!given.contains(plane.stream)) out.alpha.push_back(plane);
  hand_on_units(input, given, out);
}

/// Hands on the units up to the input's newest whole capture, but for streams that are `given`. A
/// stream that another input gave so far goes on with a key frame.
void InputSynchronizer::hand_on_units(std::size_t input, const std::set<StreamId>& given,
                                      CaptureSet& out) {
  Input& from = inputs_[input];
  const auto later = std::find_if(from.units.begin(), from.units.end(), [&](const Unit& unit) {
    return unit.captured_at > from.whole->captured_at;
  });
  for (auto waiting = from.units.begin(); waiting != later; ++waiting) {
    TextureUnit& unit = waiting->unit;
    if (given.contains(unit.stream)) continue;
    std::size_t& giver = stream_from_.try_emplace(unit.stream, input).first->second;
    if (unit.key_frame) giver = input;
    if (giver == input)
      out.units.push_back(std::move(unit));
    else
      from.stream.want_key_frame(unit.stream);
  }
  from.units.erase(from.units.begin(), later);
}

}  // namespace mr::node
