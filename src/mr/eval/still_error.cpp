#include "mr/eval/still_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/eval/draw_scene.h"
#include "mr/eval/reference.h"
#include "mr/eval/sensor_coverage.h"
#include "mr/kit/raycast.h"
#include "mr/node/sources.h"
#include "mr/runtime/lockstep_scene.h"
#include "mr/sensor/registration.h"
#include "mr/synth/truth.h"

namespace mr::eval {
namespace {

constexpr int kCheckEvery = 10;  // captures: how often it is looked what sensors see

/// A capture that reached the client.
struct ShownCapture {
  int capture = 0;
  bool key_frame = false;
  DecodedScene scene;
};

/// What a client had of the last captures, oldest first.
struct ShownRun {
  std::vector<ShownCapture> last;
  int first = -1;  ///< the first capture that was shown
};

/// Runs a scene up to its `end`-th capture and keeps the last ones.
Result<ShownRun> run_and_keep(const Scene& scene, int end, int kept,
                              const StillErrorConfig& config) {
  auto pipeline = runtime::LockstepScene::open(scene, config.rig_cache);
  if (!pipeline) return pipeline.error();
  ShownRun out;
  int offset = 0;  // of the listener's numbers
  std::optional<DecodedScene> shown;
  runtime::RunListener listener;
  listener.dropped = listener.warned = config.notice;
  listener.shown = [&](int, const DecodedScene& decoded) { shown = decoded; };
  listener.captured = [&](int i, const runtime::CaptureCost& cost) {
    const int capture = offset + i;
    if (config.progress) config.progress("stream", capture, end);
    if (!cost.shown) return;
    if (out.first < 0) out.first = capture;
    if (capture >= end - kept) out.last.push_back({capture, cost.key_frame, *std::move(shown)});
  };
  if (!scene.still.layers && end > kept + 1) {
    // A stateless pipeline: the first capture gives first_s, the last ones everything else.
    if (const auto begun = (*pipeline)->run(1, listener); !begun) return begun.error();
    offset = end - kept;
    (*pipeline)->skip(static_cast<std::uint64_t>(offset) - 1);
  }
  if (const auto ran = (*pipeline)->run(end - offset, listener); !ran) return ran.error();
  if (out.last.empty())
    return Error{Error::Cause::empty, fmt::format("scene '{}' has no capture {}", scene.id, end)};
  return out;
}

Mesh shown_mesh(const DecodedScene& scene, bool only_still) {
  Mesh out;
  for (const auto& chunk : scene.chunks)
    if (!only_still || chunk->key.id.layer == Layer::still) append(out, chunk->mesh);
  return out;
}

Mesh truth_at(synth::Truth& truth, const Scene& scene, int capture) {
  return truth.surface(static_cast<std::uint64_t>(truth_frame(scene, capture))).mesh;
}

// -------------------------------------------------- pictures

using Same = std::vector<bool>;  // [H·W]

/// For each pair of captures, where the truth is covered and the same in both.
std::vector<Same> unchanged_truth(synth::TruthView& view, const Scene& scene,
                                  const std::vector<ShownCapture>& shown) {
  const auto at = [&](const ShownCapture& one) {
    return view.at(static_cast<std::uint64_t>(truth_frame(scene, one.capture)));
  };
  std::vector<Same> out;
  synth::TruthPicture before = at(shown.front());
  for (std::size_t i = 1; i < shown.size(); ++i) {
    synth::TruthPicture now = at(shown[i]);
    Same& same = out.emplace_back(now.depth.data.size());
    for (std::size_t p = 0; p < same.size(); ++p)
      same[p] =
          now.depth.data[p] > 0 && now.depth.data[p] == before.depth.data[p] &&
          std::equal(&now.color.data[3 * p], &now.color.data[3 * p] + 3, &before.color.data[3 * p]);
    before = std::move(now);
  }
  return out;
}

struct ChangedPixels {
  std::uint64_t changed = 0, all = 0;
};

void count_changed(const RenderedView& before, const RenderedView& now, const Same& same, int level,
                   ChangedPixels& out) {
  for (std::size_t p = 0; p < same.size(); ++p) {
    if (!same[p] || !(before.covered.data[p] | now.covered.data[p])) continue;
    int most = 0;
    for (std::size_t c = 3 * p; c < 3 * p + 3; ++c)
      most = std::max(most, std::abs(now.color.data[c] - before.color.data[c]));
    ++out.all;
    out.changed += most > level;
  }
}

/// Draws all captures from all viewpoints and compares each with the one before.
Status compare_pictures(const Scene& scene, synth::Truth& truth,
                        const std::vector<render::Viewpoint>& views,
                        const std::vector<ShownCapture>& shown, const StillErrorConfig& config,
                        StillError& out) {
  const auto show_progress = [&](const char* step, std::size_t done, std::size_t of) {
    if (config.progress) config.progress(step, done, of);
  };
  std::vector<std::vector<Same>> same;  // [views][pairs]
  for (const render::Viewpoint& view : views) {
    show_progress("truth", same.size(), views.size());
    same.push_back(unchanged_truth(*truth.view(view.camera, view.T_world_camera), scene, shown));
  }
  auto renderer = render::Renderer::create();
  if (!renderer) return renderer.error();
  std::vector<RenderedView> before(views.size());
  ChangedPixels pixels;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    show_progress("compare", i, shown.size());
    const bool counts =
        i > 0 && !shown[i].key_frame && shown[i].capture == shown[i - 1].capture + 1;
    out.pairs += counts;
    for (std::size_t v = 0; v < views.size(); ++v) {
      auto now = draw_scene(*renderer, shown[i].scene, views[v]);
      if (!now) return now.error();
      if (counts) count_changed(before[v], *now, same[v][i - 1], config.level, pixels);
      before[v] = *std::move(now);
    }
  }
  out.changed_ratio =
      pixels.all > 0 ? static_cast<double>(pixels.changed) / static_cast<double>(pixels.all) : 0;
  return {};
}

// -------------------------------------------------- surfaces

/// Samples of the truth that stays and that some sensor saw within the last seconds.
struct SeenTruth {
  std::vector<SurfaceSample> samples;
  std::vector<std::uint8_t> now;       ///< [samples] whether one sees it now
  std::vector<std::uint8_t> measured;  ///< whether one did not only see it, but read its distance
};

/// The depth pictures of a scene's sensors, capture by capture.
class DepthPictures {
 public:
  /// `frustums`: where the sensors really stand.
  DepthPictures(const Scene& scene, const std::vector<SensorFrustum>& frustums,
                const std::filesystem::path& rig_cache)
      : scene_(scene) {
    const std::vector<SensorId> all = all_sensors(scene.sensors);
    for (const SensorId id : all) {
      registrations_.emplace_back(scene.sensor(id), id);
      T_depth_world_.push_back(frustums[index_of(id)].T_world_depth.inverse());
    }
    sources_ = node::open_sources(scene, all, rig_cache);
    frames_.resize(sources_.size());
  }

  /// Captures come in rising order.
  void read(int capture) {
    for (std::size_t i = 0; i < sources_.size(); ++i) {
      sources_[i]->skip(static_cast<std::uint64_t>(capture - next_));
      auto frame = sources_[i]->next();
      frames_[i] = frame && *frame ? registrations_[i].undistort(**std::move(frame)) : Frame{};
    }
    next_ = capture + 1;
  }

  /// Whether some sensor read the distance of a place.
  bool hold(Vec3f p_world) const {
    for (std::size_t i = 0; i < frames_.size(); ++i)
      if (!frames_[i].depth.empty() && holds(i, vec_cast<double>(p_world))) return true;
    return false;
  }

 private:
  bool holds(std::size_t i, Vec3d p_world) const {
    constexpr double kSigmas = 3.5;
    const Frame& frame = frames_[i];
    const Camera& camera = registrations_[i].depth_camera();
    const Vec3d p = T_depth_world_[i] * p_world;
    const auto pixel = project(camera, p);
    if (!pixel) return false;
    const int x = static_cast<int>(std::lround(pixel->x)),
              y = static_cast<int>(std::lround(pixel->y));
    if (!frame.depth.contains(x, y)) return false;
    const double read = *frame.depth.at(x, y),
                 is = camera.model == CameraModel::pinhole ? p.z : length(p);
    return read > 0 && std::abs(read - is) <=
                           scene_.voxel_m + kSigmas * scene_.sensors[i].precision.sigma_m(is);
  }

  const Scene& scene_;
  std::vector<sensor::Registration> registrations_;
  std::vector<Pose> T_depth_world_;
  std::vector<std::unique_ptr<FrameSource>> sources_;
  std::vector<Frame> frames_;
  int next_ = 0;
};

SeenTruth seen_truth(const Scene& scene, synth::Truth& truth, int now, int oldest,
                     const StillErrorConfig& config) {
  const Mesh surface = truth_at(truth, scene, now);
  const auto still = still_triangles(surface, truth_at(truth, scene, oldest));
  SeenTruth out;
  out.samples = sample_surface(surface, config.samples, 1);
  const auto captured = captured_half_spaces(scene);
  std::erase_if(out.samples, [&](const SurfaceSample& sample) {
    return !still[sample.triangle] || std::ranges::any_of(captured, [&](const HalfSpace& space) {
      return dot(space.normal, vec_cast<double>(sample.position)) < space.least_m;
    });
  });
  const std::vector<SensorFrustum> frustums = sensor_frustums(scene);
  DepthPictures pictures(scene, frustums, config.rig_cache);
  std::vector<std::uint8_t> lately(out.samples.size()), seen;
  out.measured.resize(out.samples.size());
  for (int capture = oldest + (now - oldest) % kCheckEvery; capture <= now;
       capture += kCheckEvery) {
    if (config.progress) config.progress("seen", capture - oldest, now - oldest + 1);
    seen = seen_samples(truth_at(truth, scene, capture), out.samples, frustums, scene.voxel_m);
    pictures.read(capture);
    parallel_for(seen.size(), 1024, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        lately[i] |= seen[i];
        if (seen[i] && !out.measured[i]) out.measured[i] = pictures.hold(out.samples[i].position);
      }
    });
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < lately.size(); ++i) {
    if (!lately[i]) continue;
    out.samples[kept] = out.samples[i], out.measured[kept] = out.measured[i];
    seen[kept++] = seen[i];
  }
  out.samples.resize(kept), out.measured.resize(kept), seen.resize(kept);
  out.now = std::move(seen);
  return out;
}

void find_missing(const SeenTruth& seen, const Mesh& shown, double voxel_m, StillError& out) {
  const Mesh* meshes[] = {&shown};
  const kit::RayScene rays(meshes);
  std::vector<std::uint8_t> missing(seen.samples.size());
  parallel_for(missing.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      missing[i] = !rays.nearest(seen.samples[i].position, static_cast<float>(voxel_m));
  });
  double all = 0, hidden = 0, all_missing = 0, hidden_missing = 0, seen_missing = 0;
  for (std::size_t i = 0; i < missing.size(); ++i) {
    seen_missing += missing[i];
    if (!seen.measured[i]) continue;
    ++all, all_missing += missing[i];
    hidden += !seen.now[i], hidden_missing += !seen.now[i] && missing[i];
  }
  if (!missing.empty()) out.seen_missing = seen_missing / static_cast<double>(missing.size());
  if (all > 0) out.hidden_missing = all_missing / all, out.hidden_ratio = hidden / all;
  if (hidden > 0) out.hidden_now_missing = hidden_missing / hidden;
}

double still_rounded(double value) { return std::round(value * 1e7) / 1e7; }

}  // namespace

std::vector<std::uint8_t> still_triangles(const Mesh& surface, const Mesh& other) {
  std::vector<std::uint8_t> out(surface.triangles.size());
  const std::size_t common = std::min(out.size(), other.triangles.size());
  for (std::size_t t = 0; t < common; ++t) {
    out[t] = surface.triangles[t] == other.triangles[t];
    for (int i = 0; i < 3 && out[t]; ++i) out[t] = surface.corner(t, i) == other.corner(t, i);
  }
  return out;
}

std::vector<std::uint8_t> wall_triangles(const Mesh& surface) {
  constexpr double kLeastArea_m2 = 1, kNormalStep = 0.01, kOffsetStep_m = 0.002;
  constexpr double kShift = 0.3;  // planes at whole millimetres lie inside their step
  using Plane = std::array<long, 4>;
  std::vector<Plane> planes(surface.triangles.size());
  std::map<Plane, double> area_m2;
  for (std::size_t t = 0; t < planes.size(); ++t) {
    const Vec3d across = vec_cast<double>(surface.area_normal(t)), normal = normalized(across);
    for (int axis = 0; axis < 3; ++axis) planes[t][axis] = std::lround(normal[axis] / kNormalStep);
    planes[t][3] =
        std::lround(dot(normal, vec_cast<double>(surface.centroid(t))) / kOffsetStep_m + kShift);
    area_m2[planes[t]] += 0.5 * length(across);
  }
  std::vector<std::uint8_t> out(planes.size());
  for (std::size_t t = 0; t < out.size(); ++t) out[t] = area_m2[planes[t]] >= kLeastArea_m2;
  return out;
}

Result<StillError> still_error(const Scene& scene, const std::vector<render::Viewpoint>& views,
                               const StillErrorConfig& config) {
  const RigConfig* rig = known_rig(scene);
  if (!rig) return no_truth(scene);
  const int end = config.captures + config.pairs;
  const auto run = run_and_keep(scene, end, config.pairs + 1, config);
  if (!run) return run.error();
  const ShownCapture& newest = run->last.back();
  Scene without = scene;
  without.still.layers = false;
  std::optional<Result<ShownRun>> anew;
  if (scene.still.layers) {
    StillErrorConfig quiet = config;
    quiet.progress = {};
    anew.emplace(run_and_keep(without, newest.capture + 1, 1, quiet));
    if (!*anew) return anew->error();
  }

  StillError out;
  out.scene = scene.id, out.layers = scene.still.layers;
  out.captures = config.captures, out.views = static_cast<int>(views.size());
  out.first_s = run->first / scene.fps;
  synth::Truth truth(*rig, scene.fps);
  if (const Status compared = compare_pictures(scene, truth, views, run->last, config, out);
      !compared)
    return compared.error();

  const Mesh surface = truth_at(truth, scene, newest.capture);
  const auto still =
      still_triangles(surface, truth_at(truth, scene, std::max(newest.capture - 1, 0)));
  std::vector<std::uint8_t> walls = wall_triangles(surface);
  for (std::size_t t = 0; t < walls.size(); ++t) walls[t] &= still[t];
  const auto to_truth = [&](const Mesh& mesh) {
    return StillError::Distance{distance_to_marked(mesh, surface, still, config.samples, 1),
                                distance_to_marked(mesh, surface, walls, config.samples, 1)};
  };
  out.still = to_truth(shown_mesh(newest.scene, scene.still.layers));
  out.anew = anew ? to_truth(shown_mesh((**anew).last.back().scene, false)) : out.still;

  const int oldest =
      std::max(0, newest.capture - static_cast<int>(std::lround(config.seen_s * scene.fps)) + 1);
  find_missing(seen_truth(scene, truth, newest.capture, oldest, config),
               shown_mesh(newest.scene, false), scene.voxel_m, out);
  return out;
}

std::string to_json(const StillError& e) {
  const nlohmann::ordered_json out{{"scene", e.scene},
                                   {"layers", e.layers},
                                   {"captures", e.captures},
                                   {"views", e.views},
                                   {"pairs", e.pairs},
                                   {"changed_ratio", still_rounded(e.changed_ratio)},
                                   {"wall_rms_mm", still_rounded(e.still.wall.rms_mm)},
                                   {"wall_p95_mm", still_rounded(e.still.wall.p95_mm)},
                                   {"still_rms_mm", still_rounded(e.still.all.rms_mm)},
                                   {"still_p95_mm", still_rounded(e.still.all.p95_mm)},
                                   {"everything",
                                    {{"wall_rms_mm", still_rounded(e.anew.wall.rms_mm)},
                                     {"wall_p95_mm", still_rounded(e.anew.wall.p95_mm)},
                                     {"still_rms_mm", still_rounded(e.anew.all.rms_mm)},
                                     {"still_p95_mm", still_rounded(e.anew.all.p95_mm)}}},
                                   {"hidden_missing", still_rounded(e.hidden_missing)},
                                   {"hidden_now",
                                    {{"ratio", still_rounded(e.hidden_ratio)},
                                     {"missing", still_rounded(e.hidden_now_missing)}}},
                                   {"seen_missing", still_rounded(e.seen_missing)},
                                   {"first_s", still_rounded(e.first_s)}};
  return out.dump(2) + "\n";
}

std::string to_text(const StillError& e) {
  std::string out =
      fmt::format("{}, {}, after {} captures\n", e.scene,
                  e.layers ? "with layers" : "made anew with every capture", e.captures);
  const auto line = [&](const char* name, const std::string& value) {
    out += fmt::format("  {:<34} {}\n", name, value);
  };
  line("still pixels that change", fmt::format("{:.4f} % between captures, {} pairs from {} views",
                                               100 * e.changed_ratio, e.pairs, e.views));
  const auto distance = [](const SurfaceDistance& d) {
    return fmt::format("{:.2f} mm RMS, {:.2f} mm 95 %", d.rms_mm, d.p95_mm);
  };
  line("still walls to the truth", distance(e.still.wall));
  line("  of one capture without layers", distance(e.anew.wall));
  line("all still surface to the truth", distance(e.still.all));
  line("  of one capture without layers", distance(e.anew.all));
  line("measured lately, missing now", fmt::format("{:.3f} %", 100 * e.hidden_missing));
  line("  of the part that is hidden now",
       fmt::format("{:.3f} % of {:.2f} %", 100 * e.hidden_now_missing, 100 * e.hidden_ratio));
  line("seen lately, missing now", fmt::format("{:.3f} %", 100 * e.seen_missing));
  line("first shown after", fmt::format("{:.3f} s", e.first_s));
  return out;
}

}  // namespace mr::eval
