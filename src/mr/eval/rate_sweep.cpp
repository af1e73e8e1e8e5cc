#include "mr/eval/rate_sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "mr/codec/packet_codec.h"
#include "mr/core/parallel.h"
#include "mr/eval/geometry_buffer.h"
#include "mr/eval/rate_features.h"
#include "mr/eval/root_inputs.h"
#include "mr/kit/video.h"
#include "mr/node/plans.h"
#include "mr/node/texture_stream.h"
#include "mr/rate/grid.h"
#include "mr/rate/rate_distortion.h"
#include "mr/runtime/lockstep_scene.h"

namespace mr::eval {
namespace {

using runtime::LockstepScene;

using rate::kBits;
using rate::TextureNode;

// The lattice's steps are compared at one decimation, with two textures.
constexpr double kErrorOfBits_voxels = 1;
constexpr TextureNode kTexturesOfBits[] = {{1, 28}, {0.7, 38}};
// Plates and still surface cost nothing in the steady state: they are at their best.
// Captures that run in full before the burst, until the still surface is handed over, and then
// until its plates are refined.
constexpr int kHandOver = 14, kRefined = 32;
// Captures of the burst that a new pipeline replays before it is measured: labels of the still
// surface are chosen again after 30, and chunks that change for that are named in heads.
constexpr int kSettling = 36;
// Texture scale of the pipelines, which are run for their geometry: pictures are drawn and encoded
// from what they note.
constexpr double kSmallScale = 0.125;

/// The scene's plan with a decimation, without pictures.
ScenePlan plan_of(const Scene& scene, double error_voxels) {
  ScenePlan out = node::scene_plan(scene, error_voxels);
  out.root.texture_scale = out.root.plate_scale = kSmallScale;
  return out;
}

/// Decodes pictures of one stream, in order, and keeps the last.
class LastPicture {
 public:
  Status add(const Packet& packet) {
    for (const TextureUnit& unit : packet.textures) {
      if (!decoder_) {
        auto made = kit::VideoDecoder::create();
        if (!made) return made.error();
        decoder_.emplace(*std::move(made));
      }
      auto picture = decoder_->decode(unit.data);
      if (!picture) return picture.error();
      last_ = luma_of(*picture);
    }
    return {};
  }
  const ImageLuma& luma() const { return last_; }

 private:
  std::optional<kit::VideoDecoder> decoder_;
  ImageLuma last_;
};

/// A moment's burst, and what the pipeline knew before it.
struct LearntMoment {
  LockstepScene::Memory memory;
  std::vector<LockstepScene::Capture> burst;
};

/// Learns the room up to a moment; the last captures before it, at most `in_full`, run in full.
Result<LearntMoment> learn_moment(LockstepScene& pipeline, const Moments& moments,
                                  std::size_t moment, int in_full) {
  const int first = moments.first[moment] + moments.later();
  const int learnt = is_stateful(pipeline.scene()) ? std::min(moments.warm_up, first) : 0;
  const int run = std::min(in_full, learnt);
  pipeline.skip(static_cast<std::uint64_t>(first - learnt));
  if (const Status ok = pipeline.learn(learnt - run); !ok) return ok.error();
  if (run > 0)
    if (const auto ran = pipeline.run(run); !ran) return ran.error();
  LearntMoment out{pipeline.memory(), {}};
  auto burst = pipeline.read(moments.burst);
  if (!burst) return burst.error();
  out.burst = *std::move(burst);
  if (out.burst.empty())
    return Error{Error::Cause::empty, "scene '" + pipeline.scene().id + "' has ended"};
  return out;
}

/// One moment's sweep under way.
class MomentSweep {
 public:
  MomentSweep(const Trial& trial, std::size_t moment, std::size_t views,
              const QualityConfig& config)
      : trial_(trial),
        scene_(trial.scene()),
        moments_(trial.moments()),
        moment_(moment),
        config_(config),
        has_layers_(is_stateful(scene_)) {
    views_ = trial.plan().views;
    views_.resize(std::min(views, views_.size()));
    if (!has_layers_) scene_.reuse_chunks = false, scene_.still.layers = false;
    sweep_.scene = scene_.id, sweep_.layers = has_layers_;
    sweep_.moment = moments_.shown(moment), sweep_.fps = scene_.fps;
    sweep_.voxel_m = scene_.voxel_m;
  }

  Result<rate::Sweep> run() {
    auto metric = trial_.metric({moment_}, views_.size(), 1, config_);
    if (!metric) return metric.error();
    metric_ = *std::move(metric);
    for (const auto step :
         {&MomentSweep::learn, &MomentSweep::reconstruct, &MomentSweep::measure_grid,
          &MomentSweep::measure_lattices, &MomentSweep::bisect, &MomentSweep::measure_plates,
          &MomentSweep::measure_stills})
      if (const Status done = (this->*step)(); !done) return done.error();
    auto features = burst_features(scene_, burst_, memory_);
    if (!features) return features.error();
    sweep_.features = *std::move(features);
    return std::move(sweep_);
  }

 private:
  struct Surface {
    baseline::Geometry geometry;
    std::vector<GeometryBuffer> buffers;  ///< [views]
  };

  // -------------------------------------------------- the learnt state

  /// Captures and learns once.
  Status learn() {
    auto pipeline = open(kBits);
    if (!pipeline) return pipeline.error();
    show("learn", 0, 1);
    auto learnt = learn_moment(**pipeline, moments_, moment_, kHandOver + kRefined);
    if (!learnt) return learnt.error();
    memory_ = std::move(learnt->memory), burst_ = std::move(learnt->burst);
    return {};
  }

  Result<std::unique_ptr<LockstepScene>> open(int bits) const {
    Scene scene = scene_;
    scene.lattice.step_exp = -bits;
    scene.coding.texture_scale = kSmallScale;
    return LockstepScene::open(std::move(scene), config_.rig_cache);
  }

  /// A pipeline of this lattice. A new one gets the learnt state, and replays the burst until its
  /// still surface has been merged, labelled and shown.
  Result<LockstepScene*> pipeline_of(int bits) {
    auto& pipeline = pipelines_[bits];
    if (!pipeline) {
      auto opened = open(bits);
      if (!opened) return opened.error();
      pipeline = *std::move(opened);
      for (int i = 0; has_layers_ && i < kSettling; i += moments_.burst) {
        pipeline->recall(memory_);
        if (const auto ran = pipeline->run(burst_); !ran) return ran.error();
      }
    }
    return pipeline.get();
  }

  std::span<const LockstepScene::Capture> last_captures(std::size_t n) const {
    return std::span(burst_).last(std::min(n, burst_.size()));
  }

  // -------------------------------------------------- halves

  /// The place of a geometry in the sweep; replays the burst where it is new.
  Result<std::size_t> geometry(double error_voxels, int bits) {
    for (std::size_t g = 0; g < sweep_.geometries.size(); ++g)
      if (sweep_.geometries[g].error_voxels == error_voxels && sweep_.geometries[g].bits == bits)
        return g;
    auto cost = replay(plan_of(scene_, error_voxels), bits);
    if (!cost) return cost.error();
    auto surface = take_surface(*pipelines_.at(bits));
    std::uint64_t triangles = 0;
    for (const auto& chunk : surface.geometry.chunks)
      if (chunk->key.id.layer == Layer::moving) triangles += chunk->mesh.triangles.size();
    sweep_.geometries.push_back({error_voxels, bits, 0, triangles});
    surfaces_.push_back(std::move(surface));
    moving_bytes_.push_back(*cost);
    for (std::size_t g = 0; g < moving_bytes_.size(); ++g)
      sweep_.geometries[g].bytes = moving_bytes_[g] + least_head_bytes_;
    return surfaces_.size() - 1;
  }

  /// Replays the burst in the learnt state. Returns the bytes of a capture's moving chunks: the
  /// median. Notes the least head: others name changes of the still surface, which are none of the
  /// steady state, and which no setting changes.
  Result<double> replay(const ScenePlan& plan, int bits) {
    const auto opened = pipeline_of(bits);
    if (!opened) return opened.error();
    LockstepScene& pipeline = **opened;
    if (const Status set = pipeline.set_plan(plan); !set) return set.error();
    // The plan reaches the sensors with the next capture; still surface is handed over.
    if (has_layers_) pipeline.recall(memory_);
    const auto settled = pipeline.run(std::span(burst_).first(has_layers_ ? burst_.size() : 1));
    if (!settled) return settled.error();
    if (has_layers_) pipeline.recall(memory_);
    std::vector<double> bytes;
    runtime::RunListener listener;
    listener.captured = [&](int, const runtime::CaptureCost& cost) {
      bytes.push_back(static_cast<double>(cost.mesh_bytes - cost.still_bytes));
      const auto head = static_cast<double>(cost.head_bytes - cost.alpha_bytes);
      least_head_bytes_ = std::min(least_head_bytes_, head);
    };
    const bool is_noted = inputs_.burst.empty();
    if (is_noted)
      listener.drawing = [&](int, const node::RootAtlas::Drawing& drawing) {
        inputs_.note(drawing);
      };
    const auto ran =
        pipeline.run(last_captures(has_layers_ || is_noted ? burst_.size() : 1), listener);
    if (!ran) return ran.error();
    std::ranges::sort(bytes);
    return bytes[(bytes.size() - 1) / 2];
  }

  /// What a client shows, with the still surface of the first geometry: that is not what varies.
  Surface take_surface(const LockstepScene& pipeline) const {
    const DecodedScene& shown = *pipeline.decoded();
    Surface out{{shown.chunks, shown.views, shown.sources}, {}};
    if (!surfaces_.empty()) {
      const auto is_still = [](const auto& chunk) { return chunk->key.id.layer == Layer::still; };
      std::erase_if(out.geometry.chunks, is_still);
      std::ranges::copy_if(surfaces_.front().geometry.chunks,
                           std::back_inserter(out.geometry.chunks), is_still);
    }
    draw(out);
    return out;
  }

  void draw(Surface& surface) const {
    surface.buffers.resize(views_.size());
    parallel_for(views_.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v)
        surface.buffers[v] = draw_geometry(surface.geometry, views_[v]);
    });
  }

  /// The burst's pictures at a scale, drawn once.
  Result<const std::vector<node::RootAtlas::Drawn>*> drawn(double scale) {
    auto& pictures = drawn_[scale];
    if (pictures.empty()) {
      CodingPlan plan;
      plan.texture_scale = scale;
      auto made = inputs_.draw(scene_, plan);
      if (!made) return made.error();
      pictures = *std::move(made);
      for (node::RootAtlas::Drawn& one : pictures)
        if (auto plates = std::exchange(one.plates, std::nullopt); plates && plates_.empty())
          plates_ = *std::move(plates);
    }
    return &pictures;
  }

  /// The place of a texture in the sweep; encodes the burst's pictures where it is new.
  Result<std::size_t> texture(double scale, int qp) {
    for (std::size_t t = 0; t < sweep_.textures.size(); ++t)
      if (sweep_.textures[t].scale == scale && sweep_.textures[t].qp == qp) return t;
    const auto pictures = drawn(scale);
    if (!pictures) return pictures.error();
    if (!plate_) {
      auto coded = encode_plates(rate::kBestPlateQp);
      if (!coded) return coded.error();
      plate_ = std::move(coded->second);
    }
    node::RootAtlas atlas(scene_);
    LastPicture last;
    rate::Sweep::Texture cost{scale, qp, 0, 0};
    for (std::size_t i = 0; i < (*pictures)->size(); ++i) {
      Packet packet;
      packet.plan.texture_qp = qp;
      if (const Status coded = atlas.encode((**pictures)[i], packet); !coded) return coded.error();
      double bytes = 0;
      for (const TextureUnit& unit : packet.textures)
        bytes += static_cast<double>(unit.data.size());
      for (const AlphaPlane& alpha : packet.alpha) bytes += static_cast<double>(alpha.data.size());
      (i == 0 ? cost.key_bytes : cost.bytes) += bytes;
      if (const Status ok = last.add(packet); !ok) return ok.error();
    }
    const std::size_t following = (*pictures)->size() - 1;
    cost.bytes = following > 0 ? cost.bytes / static_cast<double>(following) : cost.key_bytes;
    sweep_.textures.push_back(cost);
    textures_.push_back(shown_with((*pictures)->back().views, last.luma(), *plate_));
    return textures_.size() - 1;
  }

  static LumaTexture shown_with(const std::vector<View>& views, const ImageLuma& live,
                                const ImageLuma& plate) {
    LumaTexture out{views, {}};
    out.pictures[node::RootAtlas::kLiveStream] = live;
    if (!plate.empty()) out.pictures[node::RootAtlas::kPlateStream] = plate;
    return out;
  }

  // -------------------------------------------------- quality

  struct Score {
    double ssim = 0, moving_ssim = 0;  ///< as in Sweep::Quality
  };
  Result<Score> score(const Surface& surface, const LumaTexture& texture) const {
    std::vector<PictureScore> scores(views_.size());
    std::vector<std::optional<Error>> wrong(views_.size());
    parallel_for(views_.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v) {
        const GeometryBuffer& buffer = surface.buffers[v];
        const auto of_view = metric_.compare(0, v, shade(buffer, texture), buffer.covered);
        if (of_view)
          scores[v] = *of_view;
        else
          wrong[v] = of_view.error();
      }
    });
    for (const auto& error : wrong)
      if (error) return *error;
    Score out;
    double moving = 0;
    for (std::size_t v = 0; v < views_.size(); ++v) {
      out.ssim += scores[v].ssim_masked / static_cast<double>(views_.size());
      moving += moving_pixels_[v] * scores[v].ssim_seen;
    }
    const double pixels = std::accumulate(moving_pixels_.begin(), moving_pixels_.end(), 0.0);
    out.moving_ssim = pixels > 0 ? moving / pixels : out.ssim;
    return out;
  }

  /// Notes which pixels show the moving surface.
  void note_moving(const Surface& surface) {
    for (std::size_t v = 0; v < views_.size(); ++v) {
      const ImageMask moving = pixels_of(surface.buffers[v], Layer::moving);
      moving_pixels_.push_back(static_cast<double>(std::ranges::count(moving.data, 1)));
      if (moving_pixels_.back() > 0) metric_.set_seen(0, v, moving);
    }
  }

  Status measure(double error_voxels, int bits, TextureNode node) {
    if (sweep_.qualities.size() >= kMostSettings) return {};
    const auto g = geometry(error_voxels, bits);
    if (!g) return g.error();
    const auto t = texture(node.scale, node.qp);
    if (!t) return t.error();
    for (const auto& known : sweep_.qualities)
      if (known.geometry == *g && known.texture == *t) return {};
    const auto quality = score(surfaces_[*g], textures_[*t]);
    if (!quality) return quality.error();
    sweep_.qualities.push_back({*g, *t, quality->ssim, quality->moving_ssim});
    show("sweep", sweep_.qualities.size(), kMostSettings);
    return {};
  }

  // -------------------------------------------------- steps

  /// The surfaces of the grid and of the lattices, so that the pictures hold what all of them use.
  Status reconstruct() {
    std::vector<std::pair<double, int>> all;
    for (const double error : rate::kErrorNodes_voxels) all.emplace_back(error, kBits);
    for (const int bits : rate::kLattices)
      if (bits != kBits) all.emplace_back(kErrorOfBits_voxels, bits);
    for (const auto& [error, bits] : all) {
      show("geometry", surfaces_.size(), all.size());
      const auto g = geometry(error, bits);
      if (!g) return g.error();
      if (*g > 0) inputs_.add_moving(surfaces_[*g].geometry.chunks);
      if (bits != kBits) pipelines_.erase(bits);
    }
    note_moving(surfaces_.front());
    return {};
  }

  Status measure_grid() {
    for (const double error : rate::kErrorNodes_voxels)
      for (const TextureNode& node : rate::kTextureNodes)
        if (const Status ok = measure(error, kBits, node); !ok) return ok;
    return {};
  }

  Status measure_lattices() {
    for (const int bits : rate::kLattices)
      for (const TextureNode& node : kTexturesOfBits)
        if (const Status ok = measure(kErrorOfBits_voxels, bits, node); !ok) return ok;
    return {};
  }

  /// The Pareto front of what was measured, by rising rate.
  std::vector<rate::RatePoint> front() const {
    std::vector<rate::RatePoint> all = rate::measured_points(sweep_), out;
    std::ranges::sort(all, {}, &rate::RatePoint::mbps);
    for (const rate::RatePoint& p : all)
      if (out.empty() || p.ssim > out.back().ssim) out.push_back(p);
    return out;
  }

  /// Measures between the two neighbours on the front that lie farthest apart, again and again.
  Status bisect() {
    std::vector<std::pair<rate::Setting, rate::Setting>> tried;
    while (sweep_.qualities.size() < kMostSettings) {
      const std::vector<rate::RatePoint> points = front();
      double widest = 0;
      std::size_t at = 0;
      for (std::size_t i = 0; i + 1 < points.size(); ++i) {
        const double gap = std::log(points[i + 1].mbps / std::max(points[i].mbps, 1e-9)) *
                           (points[i + 1].ssim - points[i].ssim);
        const std::pair pair(points[i].setting, points[i + 1].setting);
        if (gap > widest && std::ranges::find(tried, pair) == tried.end()) widest = gap, at = i;
      }
      if (widest <= 0) return {};
      const auto &low = points[at].setting, &high = points[at + 1].setting;
      tried.emplace_back(low, high);
      const double error = std::round(std::sqrt(low.error_voxels * high.error_voxels) * 100) / 100;
      const int qp = low.scale == high.scale ? (low.qp + high.qp) / 2 : high.qp + 3;
      if (const Status ok = measure(error, high.bits == low.bits ? high.bits : kBits,
                                    {high.scale, std::min(qp, 51)});
          !ok)
        return ok;
    }
    return {};
  }

  Result<std::pair<double, ImageLuma>> encode_plates(int qp) const {
    if (plates_.empty()) return std::pair(0.0, ImageLuma{});
    node::TextureStream stream(scene_, node::RootAtlas::kPlateStream, false);
    auto unit = stream.encode(plates_, qp, 0);
    if (!unit) return unit.error();
    Packet packet;
    packet.textures.push_back(*std::move(unit));
    LastPicture last;
    if (const Status ok = last.add(packet); !ok) return ok.error();
    return std::pair(static_cast<double>(packet.textures.front().data.size()), last.luma());
  }

  Status measure_plates() {
    if (!has_layers_ || plates_.empty()) return {};
    const LumaTexture& best = textures_.front();
    for (const int qp : rate::kPlateNodes_qp) {
      const auto coded = encode_plates(qp);
      if (!coded) return coded.error();
      const auto quality = score(
          surfaces_.front(),
          shown_with(best.views, best.pictures.at(node::RootAtlas::kLiveStream), coded->second));
      if (!quality) return quality.error();
      sweep_.plates.push_back({qp, coded->first, quality->ssim});
    }
    return {};
  }

  /// The still surface at several errors. Last: the pipeline has another one afterwards.
  Status measure_stills() {
    if (!has_layers_) return {};
    for (const double error : rate::kStillNodes_voxels) {
      ScenePlan plan = plan_of(scene_, rate::kErrorNodes_voxels[0]);
      for (const SensorId id : all_sensors(scene_.sensors)) {
        CodingPlan of_sensor = plan.of(id);
        if (of_sensor.still_error_m > 0) of_sensor.still_error_m = error * scene_.voxel_m;
        plan.by_sensor[id] = of_sensor;
      }
      if (const auto ran = replay(plan, kBits); !ran) return ran.error();
      const DecodedScene& shown = *pipelines_.at(kBits)->decoded();
      Surface surface{{shown.chunks, shown.views, shown.sources}, {}};
      draw(surface);
      const auto quality = score(surface, textures_.front());
      if (!quality) return quality.error();
      sweep_.stills.push_back({error, still_bytes(*pipelines_.at(kBits)), quality->ssim});
      show("still", sweep_.stills.size(), 3);
    }
    return {};
  }

  static double still_bytes(const LockstepScene& pipeline) {
    double out = 0;
    if (const auto packet = codec::decode_packet(pipeline.last_mesh()))
      for (const EncodedChunk& chunk : packet->chunks)
        if (chunk.key.id.layer == Layer::still) out += static_cast<double>(chunk.payload.size());
    return out;
  }

  void show(const char* step, std::size_t done, std::size_t of) const {
    if (config_.progress) config_.progress(step, done, of);
  }

  const Trial& trial_;
  Scene scene_;
  const Moments& moments_;
  std::size_t moment_;
  const QualityConfig& config_;
  bool has_layers_;
  std::vector<render::Viewpoint> views_;
  MultiViewSsim metric_;
  std::vector<double> moving_pixels_;  ///< [views_] that show the moving surface
  std::map<int, std::unique_ptr<LockstepScene>> pipelines_;  ///< by bits
  LockstepScene::Memory memory_;
  std::vector<LockstepScene::Capture> burst_;
  RootInputs inputs_;
  std::map<double, std::vector<node::RootAtlas::Drawn>> drawn_;  ///< by scale
  ImageRgb plates_;                                              ///< empty: there are none
  std::optional<ImageLuma> plate_;                               ///< decoded, at kBestPlateQp
  std::vector<Surface> surfaces_;                                ///< [sweep_.geometries]
  std::vector<double> moving_bytes_;                             ///< [sweep_.geometries]
  double least_head_bytes_ = std::numeric_limits<double>::infinity();
  std::vector<LumaTexture> textures_;  ///< [sweep_.textures]
  rate::Sweep sweep_;
};

}  // namespace

Result<rate::Sweep> sweep_moment(const Trial& trial, std::size_t moment, std::size_t views,
                                 const QualityConfig& config) {
  return MomentSweep(trial, moment, views, config).run();
}

Result<std::vector<rate::Feature>> features_at(const Trial& trial, std::size_t moment,
                                               const QualityConfig& config) {
  Scene scene = trial.scene();
  scene.coding.texture_scale = kSmallScale;
  auto pipeline = LockstepScene::open(std::move(scene), config.rig_cache);
  if (!pipeline) return pipeline.error();
  const auto learnt = learn_moment(**pipeline, trial.moments(), moment, kHandOver);
  if (!learnt) return learnt.error();
  return burst_features((*pipeline)->scene(), learnt->burst, learnt->memory);
}

}  // namespace mr::eval
