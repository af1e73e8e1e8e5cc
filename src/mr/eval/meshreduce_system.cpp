#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include "mr/codec/packet_codec.h"
#include "mr/codec/receiver.h"
#include "mr/eval/root_inputs.h"
#include "mr/eval/system_parts.h"
#include "mr/kit/video.h"
#include "mr/node/plans.h"
#include "mr/runtime/lockstep_scene.h"

namespace mr::eval {
namespace {

using Bytes = baseline::Bytes;

Bytes bytes_of(const std::vector<double>& values) {
  const auto bytes = std::as_bytes(std::span(values));
  return {bytes.begin(), bytes.end()};
}

std::vector<double> values_from(const Bytes& bytes) {
  std::vector<double> out(bytes.size() / sizeof(double));
  if (!out.empty()) std::memcpy(out.data(), bytes.data(), out.size() * sizeof(double));
  return out;
}

/// MeshReduce itself: the whole pipeline is run in each geometry setting, and what the root's
/// pictures are drawn from is noted on the way in one of them, so that every texture setting is
/// drawn and coded from it.
///
/// A pipeline that is stateful is run once through all moments, from the warm-up on; another one
/// separately for each moment, and every capture of it is coded for itself.
///
/// A coded geometry is the whole mesh of the last capture, and what each capture cost: of the
/// second before where the pipeline is stateful, else the last one. A coded texture is the burst's
/// packets without geometry.
class MeshReduceSystem final : public System {
 public:
  MeshReduceSystem(std::filesystem::path folder, const Scene& scene, const SystemConfig& config)
      : System(std::move(folder)),
        scene_(scene),
        config_(config),
        is_stateful_(is_stateful(scene)) {
    if (!is_stateful_) scene_.reuse_chunks = false;
  }
  std::string name() const override { return "MeshReduce"; }

 private:
  struct Inputs : RootInputs {
    bool all_settings = false;  ///< they hold what moves in every setting
  };
  using Coded = std::vector<Bytes>;

  GeometrySetting first_setting() const {
    return config_.mask_for.empty() ? geometry_setting(scene_) : config_.mask_for.front();
  }

  Scene geometry_only(const GeometrySetting& setting) const {
    Scene scene = with(scene_, setting);
    scene.coding.texture_scale = 0.125;  // pictures are coded apart
    return scene;
  }

  // -------------------------------------------------- running

  Result<std::unique_ptr<runtime::LockstepScene>> open(const GeometrySetting& setting) const {
    return runtime::LockstepScene::open(geometry_only(setting), config_.rig_cache);
  }

  /// Runs the pipeline until what a setting gives at a moment is there.
  Status run(const GeometrySetting& setting, std::size_t moment) {
    return is_stateful_ ? run_through(setting) : run_at(setting, moment);
  }

  /// From the warm-up through all moments.
  Status run_through(const GeometrySetting& setting) {
    auto pipeline = open(setting);
    if (!pipeline) return pipeline.error();
    const Moments& moments = config_.moments;
    const int second = std::max(moments.burst, static_cast<int>(std::lround(scene_.fps)));
    int at = moments.fed_from(), begun = at;  // the next capture; the run's first
    std::vector<double> bytes;                // of each since the last moment
    runtime::RunListener listener;
    listener.captured = [&](int, const runtime::CaptureCost& cost) {
      bytes.push_back(static_cast<double>(cost.mesh_bytes + cost.head_bytes));
    };
    if (setting == first_setting()) {
      inputs_.clear();
      listener.drawing = [&](int i, const node::RootAtlas::Drawing& drawing) {
        for (std::size_t m = 0; m < moments.first.size(); ++m) {
          const int place = begun + i - moments.shown(m) - moments.later();
          if (place <= 0 && place > -moments.burst) inputs_[m].note(drawing);
        }
      };
    }
    (*pipeline)->skip(static_cast<std::uint64_t>(at));
    for (std::size_t m = 0; m < moments.first.size(); ++m) {
      const int end = moments.shown(m) + moments.later() + 1;
      if (const int most = moments.warm_up + moments.burst; m > 0 && end - at > most) {
        (*pipeline)->skip(static_cast<std::uint64_t>(end - at - most));
        at = end - most;
      }
      bytes.clear(), begun = at;
      if (const auto ran = (*pipeline)->run(end - at, listener); !ran) return ran.error();
      at = end;
      if (static_cast<int>(bytes.size()) > second) bytes.erase(bytes.begin(), bytes.end() - second);
      coded_[{setting, m}] = {(*pipeline)->last_mesh(), bytes_of(bytes)};
    }
    return {};
  }

  /// A moment's last capture; in the setting that is noted, its whole burst.
  Status run_at(const GeometrySetting& setting, std::size_t moment) {
    auto pipeline = open(setting);
    if (!pipeline) return pipeline.error();
    const bool is_noted = setting == first_setting();
    const int captures = is_noted ? config_.moments.burst : 1;
    double bytes = 0;  // of the last
    runtime::RunListener listener;
    listener.captured = [&](int, const runtime::CaptureCost& cost) {
      bytes = static_cast<double>(cost.mesh_bytes + cost.head_bytes);
    };
    if (is_noted) {
      inputs_.erase(moment);
      listener.drawing = [&](int, const node::RootAtlas::Drawing& drawing) {
        inputs_[moment].note(drawing);
      };
    }
    (*pipeline)->skip(static_cast<std::uint64_t>(config_.moments.shown(moment) + 1 - captures));
    if (const auto ran = (*pipeline)->run(captures, listener); !ran) return ran.error();
    coded_[{setting, moment}] = {(*pipeline)->last_mesh(), bytes_of({bytes})};
    return {};
  }

  // -------------------------------------------------- geometry

  Result<Coded> encode(const GeometrySetting& setting, std::size_t moment) override {
    if (!coded_.contains({setting, moment}))
      if (const Status ran = run(setting, moment); !ran) return ran.error();
    return coded_.at({setting, moment});
  }

  Result<baseline::Geometry> decode(const GeometrySetting& setting, const Coded& coded) override {
    const auto packet = codec::decode_packet(coded.front());
    if (!packet) return packet.error();
    codec::Receiver receiver(with(scene_, setting).lattice);
    if (const auto wrong = receiver.accept(*packet); !wrong.empty()) return wrong.front();
    auto chunks = receiver.mesh();
    if (!chunks) return Error{Error::Cause::empty, "a coded mesh is not whole"};
    return baseline::Geometry{*std::move(chunks), packet->views, packet->sources};
  }

  /// A refresh is all chunks; heads come anyway.
  Cost geometry_cost(const Coded& coded) const override {
    Cost out{values_from(coded.at(1)), is_stateful_, 0};
    if (!is_stateful_) return out;
    if (const auto packet = codec::decode_packet(coded.at(0)))
      for (const EncodedChunk& chunk : packet->chunks)
        out.refresh_bytes += static_cast<double>(chunk.payload.size());
    return out;
  }

  // -------------------------------------------------- texture

  /// The textures hold what is used by what moves in any setting, as they are coded apart from it.
  Result<const Inputs*> inputs(std::size_t moment) {
    if (!inputs_.contains(moment))
      if (const Status ran = run(first_setting(), moment); !ran) return ran.error();
    const auto found = inputs_.find(moment);
    if (found == inputs_.end() || found->second.burst.empty())
      return Error{Error::Cause::empty, "scene '" + scene_.id + "' has no colour"};
    Inputs& in = found->second;
    if (std::exchange(in.all_settings, true)) return &in;
    for (const GeometrySetting& setting : config_.mask_for) {
      if (setting == first_setting()) continue;
      const auto surface = geometry(setting, moment);
      if (!surface) return surface.error();
      in.add_moving(surface->decoded.chunks);
    }
    return &in;
  }

  Result<Coded> encode(const TextureSetting& setting, std::size_t moment) override {
    const auto in = inputs(moment);
    if (!in) return in.error();
    const Scene scene = with(scene_, setting);
    const CodingPlan plan = node::merger_plan(scene, true);
    auto pictures = (*in)->draw(scene, plan);
    if (!pictures) return pictures.error();
    node::RootAtlas atlas(scene);
    Coded out;
    for (std::size_t i = 0; i < pictures->size(); ++i) {
      Packet packet;
      packet.scene = scene.id, packet.node = scene.mergers.back().id;
      packet.sequence = i, packet.captured_at = (*in)->burst[i].captures.tick;
      packet.plan = plan;
      if (const Status coded = atlas.encode(std::move((*pictures)[i]), packet); !coded)
        return coded.error();
      out.push_back(codec::encode_packet(packet));
    }
    return out;
  }

  Result<baseline::Texture> decode(const TextureSetting&, std::size_t,
                                   const Coded& coded) override {
    std::map<StreamId, kit::VideoDecoder> decoders;
    baseline::Texture out;
    for (const Bytes& bytes : coded) {
      const auto packet = codec::decode_packet(bytes);
      if (!packet) return packet.error();
      out.views = packet->views;
      for (const TextureUnit& unit : packet->textures) {
        if (!decoders.contains(unit.stream)) {
          auto decoder = kit::VideoDecoder::create();
          if (!decoder) return decoder.error();
          decoders.emplace(unit.stream, *std::move(decoder));
        }
        auto picture = decoders.at(unit.stream).decode(unit.data);
        if (!picture) return picture.error();
        out.pictures[unit.stream] = std::make_shared<const ImageRgb>(*std::move(picture));
      }
    }
    return out;
  }

  /// The plates' key frames are part of a refresh.
  Cost texture_cost(const Coded& coded) const override {
    Cost out;
    for (const Bytes& bytes : coded) {
      const auto packet = codec::decode_packet(bytes);
      double& sum = out.bytes.emplace_back(0);
      if (!packet) continue;
      for (const TextureUnit& unit : packet->textures) {
        const bool refresh = out.bytes.size() == 1 && unit.stream == node::RootAtlas::kPlateStream;
        (refresh ? out.refresh_bytes : sum) += static_cast<double>(unit.data.size());
      }
    }
    return out;
  }

  Scene scene_;
  SystemConfig config_;
  bool is_stateful_;
  std::map<std::size_t, Inputs> inputs_;  ///< by moment
  std::map<std::pair<GeometrySetting, std::size_t>, Coded> coded_;
};

}  // namespace

std::unique_ptr<System> make_meshreduce_system(std::filesystem::path folder, const Scene& scene,
                                               const SystemConfig& config) {
  return std::make_unique<MeshReduceSystem>(std::move(folder), scene, config);
}

}  // namespace mr::eval
