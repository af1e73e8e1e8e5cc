#include "mr/eval/system.h"

#include <fmt/format.h>

#include <cstring>
#include <optional>
#include <utility>

#include "mr/core/file.h"
#include "mr/eval/system_parts.h"
#include "mr/node/capture.h"

namespace mr::eval {
namespace {

using Bytes = baseline::Bytes;

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

/// The pictures and poses that a scene's sensors read.
void add_inputs(const Scene& scene, Fingerprint& print) {
  for (const SensorConfig& sensor : scene.sensors) {
    for (const Pose& pose : sensor.T_world_depth) print.add(pose);
    for (const auto& file : sensor.source.files()) print.add_file(file);
  }
}

std::vector<double> sizes(const std::vector<Bytes>& coded) {
  std::vector<double> out;
  for (const Bytes& bytes : coded) out.push_back(static_cast<double>(bytes.size()));
  return out;
}

}  // namespace

Scene with(Scene scene, const GeometrySetting& setting) {
  // The truncation band stays as many voxels wide.
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

Result<std::span<const Capture>> Bursts::at(std::size_t moment) {
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
  return CodedGeometry{geometry_cost(*bytes), *std::move(decoded)};
}

Result<CodedTexture> System::texture(const TextureSetting& setting, std::size_t moment) {
  const auto bytes = coded(setting, moment);
  if (!bytes) return bytes.error();
  auto decoded = decode(setting, moment, *bytes);
  if (!decoded) return decoded.error();
  return CodedTexture{texture_cost(*bytes), *std::move(decoded)};
}

Result<Cost> System::texture_cost(const TextureSetting& setting, std::size_t moment) {
  const auto bytes = coded(setting, moment);
  if (!bytes) return bytes.error();
  return texture_cost(*bytes);
}

Cost System::geometry_cost(const std::vector<Bytes>& coded) const { return {sizes(coded)}; }
Cost System::texture_cost(const std::vector<Bytes>& coded) const { return {sizes(coded)}; }

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
  for (const std::string& option : scene.set) print.add(option);
  add_inputs(scene, print);
  for (const int first : config.moments.first) print.add(static_cast<double>(first));
  print.add(static_cast<double>(config.moments.burst));
  print.add(static_cast<double>(config.moments.warm_up));
  // Commands may set these beside the file.
  print.add(scene.still.layers ? 1.0 : 0.0).add(scene.still.after_s);
  for (const GeometrySetting& setting : config.mask_for) print.add(to_string(setting));
  auto folder = store_folder(config.eval_cache, "coded-" + print.hex());
  if (scene.pipeline == "meshreduce")
    return make_meshreduce_system(std::move(folder), scene, config);
  if (const auto made = baseline::make_baseline(scene); !made) return made.error();
  return std::unique_ptr<System>(
      std::make_unique<BaselineSystem>(std::move(folder), scene, config));
}

}  // namespace mr::eval
