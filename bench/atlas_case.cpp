#include "atlas_case.h"

#include <stdexcept>

#include "bytes.h"
#include "mr/baseline/monolithic.h"
#include "mr/core/parallel.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"
#include "mr/node/capture.h"
#include "mr/node/sensor_node.h"
#include "mr/simplify/simplify.h"
#include "mr/synth/room.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

const std::string kFull = "full", kMoving = "moving";
constexpr std::size_t kTriangles = 200'000;
constexpr double kOfPeople = 0.2;     // of the triangles that fusion gives
constexpr float kOffStill_m = 0.03f;  // what lies farther from the room moves
constexpr auto kRendering = std::chrono::hours(1);

Scene office(int people) {
  RigConfig rig;
  rig.kind = RigConfig::Kind::office, rig.seed = 32, rig.people = people;
  rig.room_m = synth::usual_room_m(rig.kind);
  rig.detail = 0.9, rig.frames = 1;
  Scene scene;
  scene.id = "atlas";
  scene.rig = rig, scene.sensors = synth::rig_sensors(rig);
  return scene;
}

Mesh welded_and_simplified(const Mesh& mesh, std::size_t triangles) {
  auto small = simplify::simplify(kit::weld(mesh), {.triangles = triangles});
  if (!small) throw std::runtime_error(small.error().message);
  clear_labels(small->mesh);
  return kit::weld(small->mesh);
}

std::vector<Frame> capture_of(const Scene& scene) {
  auto frames = node::CaptureReader(scene, synth::default_rig_cache()).next();
  if (!frames) throw std::runtime_error("the rig has no frame");
  return *std::move(frames);
}

/// The triangles of a surface that lie off another.
Mesh off(const Mesh& surface, const Mesh& other) {
  const Mesh* const meshes[] = {&other};
  const kit::RayScene scene(meshes);
  std::vector<std::uint8_t> keep(surface.triangles.size());
  parallel_for(keep.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t)
      keep[t] = !scene.nearest(surface.centroid(t), kOffStill_m);
  });
  return select_triangles(surface, keep);
}

Message atlas_message(const std::string& name) {
  Message out;
  Arena(0).run([&] {
    const Scene scene = office(3);
    const std::vector<Frame> frames = capture_of(scene);
    const Mesh whole = baseline::fuse_all(scene, frames, scene.voxel_m);
    if (name == kFull) {
      out["surface"] = to_message(welded_and_simplified(whole, kTriangles)),
      out["still"] = to_message({});
    } else {
      const Scene empty = office(0);
      const Mesh room = baseline::fuse_all(empty, capture_of(empty), scene.voxel_m);
      const Mesh people = off(whole, room);
      const Mesh surface = welded_and_simplified(people, simplify::triangles_at(people, kOfPeople));
      out["surface"] = to_message(surface);
      out["still"] = to_message(welded_and_simplified(room, kTriangles - surface.triangles.size()));
    }
    const std::vector<View> views = baseline::color_views(scene, frames);
    out["views"] = binary(views);
    for (const View& view : views)
      for (const Frame& frame : frames)
        if (view_of(frame.sensor) == view.id) out["pictures"].push_back(binary(frame.color.data));
    out["voxel_m"] = scene.voxel_m, out["error_m"] = node::texturing_error_m(scene, 0.005f);
  });
  return out;
}

}  // namespace

std::vector<CaseInfo> atlas_cases() {
  return {{kFull, "an office with three people, 200,000 triangles, four views", true, ""},
          {kMoving, "the people alone, before the still office of 200,000 triangles", true, ""}};
}

Result<AtlasCase> load_atlas_case(const std::string& name) {
  const auto made = apart([&] { return atlas_message(name); }, kRendering);
  if (!made) return made.error();
  AtlasCase out;
  out.name = name;
  out.surface = mesh_from(made->at("surface")), out.still = mesh_from(made->at("still"));
  out.views = array_from<View>(made->at("views"));
  for (std::size_t v = 0; v < out.views.size(); ++v) {
    ImageRgb picture(out.views[v].width, out.views[v].height);
    const auto pixels = array_from<std::uint8_t>(made->at("pictures").at(v));
    picture.data.assign(pixels.begin(), pixels.end());
    out.pictures.push_back(std::move(picture));
  }
  out.voxel_m = made->at("voxel_m"), out.error_m = made->at("error_m");
  return out;
}

}  // namespace mr::bench
