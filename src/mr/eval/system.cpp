#include "mr/eval/system.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <utility>

#include "mr/atlas/compose.h"
#include "mr/atlas/labels.h"
#include "mr/atlas/layout.h"
#include "mr/baseline/monolithic.h"
#include "mr/codec/packet_codec.h"
#include "mr/codec/receiver.h"
#include "mr/core/file.h"
#include "mr/kit/video.h"
#include "mr/node/capture.h"
#include "mr/node/pipeline.h"
#include "mr/node/sensor_node.h"
#include "mr/node/texture_stream.h"

namespace mr::eval {
namespace {

using Bytes = baseline::Bytes;
using Capture = std::vector<Frame>;

Scene with(Scene scene, const GeometrySetting& setting) {
  // The band grows with the voxels, and never shrinks below what the scene asks for.
  const double voxels = scene.fusion.truncation_m / scene.voxel_m;
  if (setting.voxel_m != scene.voxel_m) scene.fusion.truncation_m = voxels * setting.voxel_m;
  scene.voxel_m = setting.voxel_m;
  scene.simplify.ratio = setting.ratio;
  scene.lattice.step_exp = setting.step_exp;
  scene.coding.depth_qp = setting.depth_qp;
  return scene;
}

Scene with(Scene scene, const TextureSetting& setting) {
  scene.coding.texture_scale = setting.scale, scene.coding.texture_qp = setting.qp;
  return scene;
}

/// Byte strings as one, each after its length.
Bytes pack(const std::vector<Bytes>& list) {
  Bytes out;
  for (const Bytes& bytes : list) {
    const std::uint64_t size = bytes.size();
    const auto* head = reinterpret_cast<const std::byte*>(&size);
    out.insert(out.end(), head, head + sizeof size);
    out.insert(out.end(), bytes.begin(), bytes.end());
  }
  return out;
}

std::optional<std::vector<Bytes>> unpack(const Bytes& packed) {
  std::vector<Bytes> list;
  for (std::size_t at = 0; at < packed.size();) {
    std::uint64_t size = 0;
    if (packed.size() - at < sizeof size) return std::nullopt;
    std::memcpy(&size, &packed[at], sizeof size);
    at += sizeof size;
    if (packed.size() - at < size) return std::nullopt;
    const auto begin = packed.begin() + static_cast<std::ptrdiff_t>(at);
    list.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(size));
    at += size;
  }
  return list.empty() ? std::nullopt : std::optional(std::move(list));
}

/// The captures of every moment's burst; read when first asked for.
class Bursts {
 public:
  Bursts(const Scene& scene, Moments moments, std::filesystem::path rig_cache)
      : scene_(&scene), moments_(std::move(moments)), rig_cache_(std::move(rig_cache)) {}

  Result<std::span<const Capture>> at(std::size_t moment) {
    auto& burst = read_[moment];
    if (burst.empty()) {
      node::CaptureReader reader(*scene_, rig_cache_);
      reader.skip(static_cast<std::uint64_t>(moments_.first.at(moment)));
      for (int i = 0; i < moments_.burst; ++i) {
        auto capture = reader.next();
        if (!capture || capture->empty())
          return Error{Error::Cause::empty, fmt::format("scene '{}' has no capture {}", scene_->id,
                                                        moments_.first[moment] + i)};
        burst.push_back(*std::move(capture));
      }
    }
    return std::span<const Capture>(burst);
  }

 private:
  const Scene* scene_;
  Moments moments_;
  std::filesystem::path rig_cache_;
  std::map<std::size_t, std::vector<Capture>> read_;
};

/// A baseline; its halves are apart already.
class BaselineSystem final : public System {
 public:
  BaselineSystem(std::filesystem::path folder, const Scene& scene, const SystemConfig& config)
      : System(std::move(folder)),
        scene_(scene),
        bursts_(scene_, config.moments, config.rig_cache) {
    if (const auto made = baseline::make_baseline(scene_)) name_ = (*made)->name();
  }
  std::string name() const override { return name_; }

 private:
  using Encode = Result<Bytes> (baseline::Baseline::*)(std::span<const Frame>);

  Result<std::vector<Bytes>> run(const Scene& scene, Encode code, bool has_state,
                                 std::size_t moment) {
    const auto coder = baseline::make_baseline(scene);
    if (!coder) return coder.error();
    const auto burst = bursts_.at(moment);
    if (!burst) return burst.error();
    std::vector<Bytes> out;
    for (const Capture& capture : has_state ? *burst : burst->last(1)) {
      auto bytes = ((**coder).*code)(capture);
      if (!bytes) return bytes.error();
      out.push_back(*std::move(bytes));
    }
    return out;
  }

  Result<std::vector<Bytes>> encode(const GeometrySetting& setting, std::size_t moment) override {
    return run(with(scene_, setting), &baseline::Baseline::encode_geometry,
               scene_.pipeline == "rgbd", moment);
  }
  Result<std::vector<Bytes>> encode(const TextureSetting& setting, std::size_t moment) override {
    return run(with(scene_, setting), &baseline::Baseline::encode_texture,
               scene_.pipeline != "holoportation", moment);
  }
  template <typename Decoded>
  Result<Decoded> replay(const Scene& scene, const std::vector<Bytes>& coded,
                         Result<Decoded> (baseline::Baseline::*read)(std::span<const std::byte>)) {
    const auto decoder = baseline::make_baseline(scene);
    if (!decoder) return decoder.error();
    Result<Decoded> last = Error{Error::Cause::empty, "nothing was coded"};
    for (const Bytes& bytes : coded)
      if (last = ((**decoder).*read)(bytes); !last) return last;
    return last;
  }
  Result<baseline::Geometry> decode(const GeometrySetting& setting,
                                    const std::vector<Bytes>& coded) override {
    return replay(with(scene_, setting), coded, &baseline::Baseline::decode_geometry);
  }
  Result<baseline::Texture> decode(const TextureSetting& setting, std::size_t,
                                   const std::vector<Bytes>& coded) override {
    return replay(with(scene_, setting), coded, &baseline::Baseline::decode_texture);
  }

  Scene scene_;
  Bursts bursts_;
  std::string name_;
};

/// MeshReduce itself. Geometry is the whole pipeline's; the atlas is composed and coded as the root
/// does it, from pictures that went through the sensors' video.
class MeshReduceSystem final : public System {
 public:
  MeshReduceSystem(std::filesystem::path folder, const Scene& scene, const SystemConfig& config)
      : System(std::move(folder)),
        scene_(scene),
        config_(config),
        bursts_(scene_, config.moments, config.rig_cache) {
    scene_.reuse_chunks = false;  // every capture is coded for itself
  }
  std::string name() const override { return "MeshReduce"; }

 private:
  using Pictures = std::map<std::uint32_t, std::shared_ptr<const ImageRgb>>;
  struct Inputs {
    std::map<ViewId, View> views;                   ///< of the sensors
    std::vector<Pictures> pictures;                 ///< [burst]
    std::vector<std::map<ViewId, ImageMask>> used;  ///< [burst]
  };

  Scene geometry_only(const GeometrySetting& setting) const {
    Scene scene = with(scene_, setting);
    scene.coding.texture_scale = 0.125;  // pictures are coded apart
    return scene;
  }

  Result<std::vector<Bytes>> encode(const GeometrySetting& setting, std::size_t moment) override {
    auto pipeline = node::Pipeline::open(geometry_only(setting), config_.rig_cache);
    if (!pipeline) return pipeline.error();
    (*pipeline)->skip(static_cast<std::uint64_t>(config_.moments.shown(moment)));
    if (const auto report = (*pipeline)->run(1); !report) return report.error();
    auto packet = codec::decode_packet((*pipeline)->last_packet());
    if (!packet) return packet.error();
    packet->textures.clear();
    return std::vector<Bytes>{codec::encode_packet(*packet)};
  }

  Result<baseline::Geometry> decode(const GeometrySetting& setting,
                                    const std::vector<Bytes>& coded) override {
    auto packet = codec::decode_packet(coded.back());
    if (!packet) return packet.error();
    codec::Receiver receiver(with(scene_, setting).lattice);
    if (const auto wrong = receiver.accept(*packet); !wrong.empty()) return wrong.front();
    auto chunks = receiver.mesh();
    if (!chunks) return Error{Error::Cause::empty, "a coded mesh is not whole"};
    return baseline::Geometry{*std::move(chunks), packet->views, packet->sources};
  }

  /// The sensors' views, posed as in the capture that is shown.
  std::map<ViewId, View> views_of(std::span<const Capture> burst) const {
    std::map<ViewId, View> views;
    for (View& view : baseline::color_views(scene_, burst.back())) views[view.id] = view;
    return views;
  }

  /// What the root is given of a moment, and what of it the surfaces show.
  Result<const Inputs*> inputs(std::size_t moment) {
    if (const auto known = inputs_.find(moment); known != inputs_.end()) return &known->second;
    const auto burst = bursts_.at(moment);
    if (!burst) return burst.error();
    Inputs in;
    in.pictures.resize(burst->size());
    in.used.resize(burst->size());
    in.views = views_of(*burst);
    if (in.views.empty())
      return Error{Error::Cause::empty, "scene '" + scene_.id + "' has no colour"};
    for (const auto& [id, view] : in.views)
      if (const Status sent = send_pictures(*burst, view.stream, in); !sent) return sent.error();
    if (scene_.atlas.mask)
      if (const Status marked = mark_used(moment, in); !marked) return marked.error();
    return &inputs_.emplace(moment, std::move(in)).first->second;
  }

  /// A sensor's pictures, through its video.
  Status send_pictures(std::span<const Capture> burst, std::uint32_t sensor, Inputs& in) const {
    node::TextureStream stream(scene_, sensor);
    auto decoder = kit::VideoDecoder::create();
    if (!decoder) return decoder.error();
    for (std::size_t i = 0; i < burst.size(); ++i)
      for (const Frame& frame : burst[i]) {
        if (frame.sensor != sensor) continue;
        const auto unit = stream.encode(frame.color, scene_.coding.sensor_texture_qp, 0);
        if (!unit) return unit.error();
        auto picture = decoder->decode(unit->data);
        if (!picture) return picture.error();
        in.pictures[i][sensor] = std::make_shared<const ImageRgb>(*std::move(picture));
      }
    return {};
  }

  using Used = std::map<ViewId, ImageMask>;
  using Chunks = std::vector<std::shared_ptr<const Chunk>>;

  /// Which pixels a surface shows, as the root finds them.
  void add_used(const Chunks& chunks, const std::map<ViewId, View>& views, Used& used) const {
    Mesh mesh;
    float error_m = 0;
    for (const auto& chunk : chunks) {
      append(mesh, chunk->mesh);
      error_m = std::max(error_m, chunk->error_m);
    }
    for (const auto& [id, view] : views) {
      const double margin = atlas::margin_px(view, node::texturing_error_m(scene_, error_m), 1.0);
      const ImageMask shown = atlas::used_pixels(mesh, view, static_cast<int>(std::ceil(margin)));
      ImageMask& all = used.try_emplace(id, shown).first->second;
      for (std::size_t i = 0; i < shown.data.size(); ++i) all.data[i] |= shown.data[i];
    }
  }

  /// What is used flickers with the noise from capture to capture, which costs bits: it is marked
  /// as the first setting shows each, and as all others show the last.
  Status mark_used(std::size_t moment, Inputs& in) {
    if (config_.mask_for.empty()) return {};
    auto pipeline =
        node::Pipeline::open(geometry_only(config_.mask_for.front()), config_.rig_cache);
    if (!pipeline) return pipeline.error();
    (*pipeline)->skip(static_cast<std::uint64_t>(config_.moments.first[moment]));
    node::RunListener listener;
    listener.shown = [&](int capture, const DecodedScene& shown) {
      add_used(shown.chunks, in.views, in.used.at(static_cast<std::size_t>(capture)));
    };
    const auto report = (*pipeline)->run(config_.moments.burst, listener);
    if (!report) return report.error();
    for (std::size_t i = 1; i < config_.mask_for.size(); ++i) {
      const auto surface = geometry(config_.mask_for[i], moment);
      if (!surface) return surface.error();
      for (Used& used : in.used) add_used(surface->decoded.chunks, in.views, used);
    }
    return {};
  }

  Result<atlas::Layout> layout(const TextureSetting& setting,
                               const std::map<ViewId, View>& views) const {
    std::vector<View> list;
    for (const auto& [id, view] : views) list.push_back(view);
    return atlas::make_layout(list, scene_.atlas, setting.scale, 0);
  }

  Result<std::vector<Bytes>> encode(const TextureSetting& setting, std::size_t moment) override {
    const auto in = inputs(moment);
    if (!in) return in.error();
    const auto tiles = layout(setting, (*in)->views);
    if (!tiles) return tiles.error();
    node::TextureStream stream(scene_, 0);
    std::vector<Bytes> out;
    for (std::size_t i = 0; i < (*in)->pictures.size(); ++i) {
      const ImageRgb atlas = atlas::compose_atlas(*tiles, (*in)->views, (*in)->pictures[i],
                                                  (*in)->used[i], scene_.atlas.mask);
      auto unit = stream.encode(atlas, setting.qp, 0);
      if (!unit) return unit.error();
      out.push_back(std::move(unit->data));
    }
    return out;
  }

  Result<baseline::Texture> decode(const TextureSetting& setting, std::size_t moment,
                                   const std::vector<Bytes>& coded) override {
    const auto burst = bursts_.at(moment);
    if (!burst) return burst.error();
    const auto tiles = layout(setting, views_of(*burst));
    if (!tiles) return tiles.error();
    auto decoder = kit::VideoDecoder::create();
    if (!decoder) return decoder.error();
    baseline::Texture out{tiles->views, {}};
    for (const Bytes& unit : coded) {
      auto picture = decoder->decode(unit);
      if (!picture) return picture.error();
      out.pictures[0] = std::make_shared<const ImageRgb>(*std::move(picture));
    }
    return out;
  }

  Scene scene_;
  SystemConfig config_;
  Bursts bursts_;
  std::map<std::size_t, Inputs> inputs_;
};

/// The pictures and poses that a scene's sensors read.
void add_inputs(const Scene& scene, Fingerprint& print) {
  for (const SensorConfig& sensor : scene.sensors) {
    for (const Pose& pose : sensor.T_world_depth) print.add(pose);
    const auto* images = std::get_if<RgbdImagesSource>(&sensor.source);
    if (!images) continue;
    for (const auto& file : images->color) print.add_file(file);
    for (const auto& file : images->depth) print.add_file(file);
  }
}

std::vector<double> sizes(const std::vector<Bytes>& coded) {
  std::vector<double> out;
  for (const Bytes& bytes : coded) out.push_back(static_cast<double>(bytes.size()));
  return out;
}

}  // namespace

GeometrySetting geometry_setting(const Scene& scene) {
  return {scene.voxel_m, scene.simplify.ratio, scene.lattice.step_exp, scene.coding.depth_qp};
}
TextureSetting texture_setting(const Scene& scene) {
  return {scene.coding.texture_scale, scene.coding.texture_qp};
}

std::string to_string(const GeometrySetting& s) {
  return fmt::format("g-{:g}-{:g}-{}-{}", s.voxel_m, s.ratio, s.step_exp, s.depth_qp);
}
std::string to_string(const TextureSetting& s) { return fmt::format("t-{:g}-{}", s.scale, s.qp); }

template <typename Setting>
Result<std::vector<Bytes>> System::coded(const Setting& setting, std::size_t moment) {
  const std::string name = fmt::format("{}-{}", moment, to_string(setting));
  if (const auto kept = store_.get(name))
    if (auto list = unpack(*kept)) return *std::move(list);
  auto made = encode(setting, moment);
  if (made) store_.put(name, pack(*made));
  return made;
}

Result<CodedGeometry> System::geometry(const GeometrySetting& setting, std::size_t moment) {
  const auto bytes = coded(setting, moment);
  if (!bytes) return bytes.error();
  auto decoded = decode(setting, *bytes);
  if (!decoded) return decoded.error();
  return CodedGeometry{sizes(*bytes), *std::move(decoded)};
}

Result<CodedTexture> System::texture(const TextureSetting& setting, std::size_t moment) {
  const auto bytes = coded(setting, moment);
  if (!bytes) return bytes.error();
  auto decoded = decode(setting, moment, *bytes);
  if (!decoded) return decoded.error();
  return CodedTexture{sizes(*bytes), *std::move(decoded)};
}

Result<std::vector<double>> System::texture_bytes(const TextureSetting& setting,
                                                  std::size_t moment) {
  const auto bytes = coded(setting, moment);
  if (!bytes) return bytes.error();
  return sizes(*bytes);
}

Store System::scores(const std::vector<render::Viewpoint>& views, ReferenceKind reference) const {
  if (folder_.empty()) return Store({});
  Fingerprint print;
  print.add(to_string(reference));
  for (const render::Viewpoint& view : views) print.add(view.camera).add(view.T_world_camera);
  return Store(folder_ / ("scores-" + print.hex()));
}

Result<std::unique_ptr<System>> make_system(const Scene& scene, const SystemConfig& config) {
  Fingerprint print;
  print.add(program_fingerprint()).add(scene.pipeline).add(scene.file.string());
  if (const auto text = read_file(scene.file)) print.add(std::span<const std::byte>(*text));
  add_inputs(scene, print);
  for (const int first : config.moments.first) print.add(static_cast<double>(first));
  print.add(static_cast<double>(config.moments.burst));
  for (const GeometrySetting& setting : config.mask_for) print.add(to_string(setting));
  auto folder = store_folder(config.eval_cache, "coded-" + print.hex());
  if (scene.pipeline == "meshreduce")
    return std::unique_ptr<System>(
        std::make_unique<MeshReduceSystem>(std::move(folder), scene, config));
  if (const auto made = baseline::make_baseline(scene); !made) return made.error();
  return std::unique_ptr<System>(
      std::make_unique<BaselineSystem>(std::move(folder), scene, config));
}

}  // namespace mr::eval
