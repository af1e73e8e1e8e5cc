#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "mr/atlas/compose.h"
#include "mr/atlas/labels.h"
#include "mr/atlas/layout.h"
#include "mr/baseline/monolithic.h"
#include "mr/codec/packet_codec.h"
#include "mr/codec/receiver.h"
#include "mr/eval/system_parts.h"
#include "mr/kit/video.h"
#include "mr/node/pipeline.h"
#include "mr/node/sensor_node.h"
#include "mr/node/texture_stream.h"

namespace mr::eval {
namespace {

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
    return decode_geometry(coded.back(), with(scene_, setting).lattice);
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

}  // namespace

Result<baseline::Geometry> decode_geometry(const baseline::Bytes& bytes, const Lattice& lattice) {
  auto packet = codec::decode_packet(bytes);
  if (!packet) return packet.error();
  codec::Receiver receiver(lattice);
  if (const auto wrong = receiver.accept(*packet); !wrong.empty()) return wrong.front();
  auto chunks = receiver.mesh();
  if (!chunks) return Error{Error::Cause::empty, "a coded mesh is not whole"};
  return baseline::Geometry{*std::move(chunks), packet->views, packet->sources};
}

std::unique_ptr<System> make_meshreduce_system(std::filesystem::path folder, const Scene& scene,
                                               const SystemConfig& config) {
  return std::make_unique<MeshReduceSystem>(std::move(folder), scene, config);
}

}  // namespace mr::eval
