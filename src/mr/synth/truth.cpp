#include "mr/synth/truth.h"

#include <cstring>
#include <optional>
#include <string>
#include <utility>

#include "mr/core/file.h"
#include "mr/synth/sensor_effects.h"
#include "mr/synth/synthetic_scene.h"
#include "mr/synth/view.h"

namespace mr::synth {
namespace {

ColoredMesh colored(const TexturedSurface& surface) {
  return {*surface.mesh, vertex_colors(surface)};
}

}  // namespace

struct Truth::Impl {
  Impl(const RigConfig& r, double rate) : rig(r), fps(rate), scene(r, rate) { scene.build(); }

  /// As the rig's own cameras without injected errors see it.
  std::shared_ptr<const PosedPeople> people(std::uint64_t frame) {
    const auto frames = static_cast<std::uint64_t>(rig.frames);
    return scene.people(static_cast<double>(rig.loop ? frame % frames : frame) / fps);
  }

  /// What 8-bit values under the usual light become at a frame; none: they stay.
  std::optional<std::array<std::uint8_t, 256>> light_at(std::uint64_t frame) const {
    const auto frames = static_cast<std::uint64_t>(rig.frames);
    const double level = light_level(rig, rig.loop ? frame % frames : frame);
    return level == 1 ? std::nullopt : std::optional(relit(level));
  }

  RigConfig rig;
  double fps;
  SyntheticScene scene;
  ColoredMesh room;  ///< once it was asked for
};

Truth::Truth(const RigConfig& rig, double fps) : impl_(std::make_unique<Impl>(rig, fps)) {}
Truth::~Truth() = default;

Mesh Truth::room() { return *textured_surface(*impl_->scene.room()).mesh; }

ColoredMesh Truth::surface(std::uint64_t frame) {
  if (impl_->room.mesh.empty()) impl_->room = colored(textured_surface(*impl_->scene.room()));
  ColoredMesh surface = impl_->room;
  if (const auto people = impl_->people(frame)) {
    const ColoredMesh bodies = colored(people->surface(static_cast<float>(2 * impl_->rig.detail)));
    append(surface.mesh, bodies.mesh);
    surface.colors.insert(surface.colors.end(), bodies.colors.begin(), bodies.colors.end());
  }
  if (const auto light = impl_->light_at(frame))
    for (auto& color : surface.colors)
      for (std::uint8_t& value : color) value = (*light)[value];
  return surface;
}

/// The truth seen by one sensor without noise.
class Truth::CameraView final : public TruthView {
 public:
  CameraView(Truth::Impl& truth, const Camera& camera, const Pose& T_world_camera)
      : truth_(truth), camera_(camera), view_(truth.scene.room(), setup(camera, T_world_camera)) {}

  TruthPicture at(std::uint64_t frame) override {
    const Shot shot = view_.render(truth_.people(frame).get(), frame);
    TruthPicture picture{view_.empty_room(), ImageDepth(camera_.width, camera_.height)};
    const std::uint8_t* from = shot.rgb.data();
    for (const Shot::Span& span : shot.spans) {
      std::memcpy(picture.color.data.data() + 3 * std::size_t{span.first}, from,
                  3 * std::size_t{span.count});
      from += 3 * std::size_t{span.count};
    }
    if (const auto light = truth_.light_at(frame))
      for (std::uint8_t& value : picture.color.data) value = (*light)[value];
    for (std::size_t i = 0; i < shot.depth_mm.size(); ++i)
      picture.depth.data[i] = static_cast<float>(shot.depth_mm[i] * 0.001);
    return picture;
  }

 private:
  static ViewSetup setup(const Camera& camera, const Pose& T_world_camera) {
    ViewSetup setup;
    setup.depth = {camera, T_world_camera};
    setup.color = setup.depth;
    setup.noise = {.on = false, .precision = {}, .near_m = 0, .far_m = 65};
    return setup;
  }

  Truth::Impl& truth_;
  Camera camera_;
  SensorView view_;
};

std::unique_ptr<TruthView> Truth::view(const Camera& camera, const Pose& T_world_camera) {
  return std::make_unique<CameraView>(*impl_, camera, T_world_camera);
}

TruthPicture Truth::render(const Camera& camera, const Pose& T_world_camera, std::uint64_t frame) {
  return view(camera, T_world_camera)->at(frame);
}

Status write_ply(const std::filesystem::path& file, const ColoredMesh& surface) {
  const Mesh& mesh = surface.mesh;
  MR_ASSERT(surface.colors.size() == mesh.positions.size());
  std::string out =
      "ply\nformat binary_little_endian 1.0\ncomment MeshReduce truth\nelement vertex " +
      std::to_string(mesh.positions.size()) +
      "\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face " +
      std::to_string(mesh.triangles.size()) +
      "\nproperty list uchar int vertex_indices\nend_header\n";
  constexpr std::size_t kVertex = 15, kFace = 13;
  std::size_t at = out.size();
  out.resize(at + mesh.positions.size() * kVertex + mesh.triangles.size() * kFace);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v, at += kVertex) {
    std::memcpy(&out[at], &mesh.positions[v], 12);
    std::memcpy(&out[at + 12], surface.colors[v].data(), 3);
  }
  for (const Triangle& triangle : mesh.triangles) {
    out[at] = 3;
    std::memcpy(&out[at + 1], triangle.data(), 12);
    at += kFace;
  }
  return write_file(file, out);
}

}  // namespace mr::synth
