#include "mr/runtime/report.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "mr/core/trace.h"

namespace mr::runtime {
namespace {

using Json = nlohmann::ordered_json;

double rounded(double v) { return std::round(v * 1000) / 1000; }

Json spread(const std::vector<double>& ms) {
  return {{"p50_ms", rounded(percentile(ms, 0.5))}, {"p95_ms", rounded(percentile(ms, 0.95))}};
}

Json stages(const RunReport::Stages& all) {
  Json out = Json::object();
  for (const auto& [stage, ms] : all) out[stage] = spread(ms);
  return out;
}

}  // namespace

std::string preset_of(const Scene& scene) {
  Json out = {{"sensors", scene.sensors.size()}, {"fps", scene.fps}, {"voxel_m", scene.voxel_m}};
  if (!scene.sensors.empty()) {
    const SensorConfig& first = scene.sensors.front();
    out["depth"] = {first.depth_camera.width, first.depth_camera.height};
    if (first.color_camera) out["color"] = {first.color_camera->width, first.color_camera->height};
  }
  if (scene.rig) {
    out["people"] = scene.rig->people;
    out["loop_s"] = rounded(scene.rig->frames / scene.fps);
    out["seed"] = scene.rig->seed;
  }
  out["sensor_ratio"] = scene.simplify.ratio, out["root_ratio"] = scene.merge.simplify.ratio;
  out["texture_qp"] = scene.coding.texture_qp;
  return out.dump();
}

double peak_rss_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

Json pairs(const std::vector<node::InputResidual>& residuals) {
  Json out = Json::array();
  for (const node::InputResidual& pair : residuals)
    out.push_back({{"a", pair.a},
                   {"b", pair.b},
                   {"residual_mm", rounded(pair.residual_mm)},
                   {"corrected_mm", rounded(pair.corrected_mm)},
                   {"shared_m2", rounded(pair.shared_m2)}});
  return out;
}

Json colors(const std::vector<node::CameraColor>& cameras) {
  Json out = Json::array();
  for (const node::CameraColor& camera : cameras)
    out.push_back(
        {{"sensor", camera.sensor},
         {"gain", {rounded(camera.gain.x), rounded(camera.gain.y), rounded(camera.gain.z)}},
         {"misfit", rounded(camera.misfit)},
         {"note", camera.note}});
  return out;
}

std::string to_json(const RunReport& r) {
  std::uint64_t dropped = 0;
  for (const auto& [cause, n] : r.drops) dropped += n;
  const Json json = {
      {"scene", r.scene},
      {"preset", Json::parse(r.preset)},
      {"frames", r.frames},
      {"fps", rounded(r.fps)},
      {"sensors", r.sensors},
      {"threads", r.threads},
      {"peak_rss_mb", rounded(r.peak_rss_mb)},
      {"triangles", r.triangles},
      {"vertices", r.vertices},
      {"mesh_bytes_per_frame", rounded(r.mesh_bytes_per_frame)},
      {"refresh_bytes", r.refresh_bytes},
      {"texture_bytes_per_frame", rounded(r.texture_bytes_per_frame)},
      {"chunks", {{"new", r.chunks_new}, {"kept", r.chunks_kept}}},
      {"drops", {{"total", dropped}, {"by", Json(r.drops)}}},
      {"nodes", {{"sensor", stages(r.sensor_stages_ms)}, {"merge", stages(r.merge_stages_ms)}}},
      {"pairs", pairs(r.pairs)},
      {"colors", colors(r.colors)},
      {"misplaced_px", rounded(r.misplaced_px)},
      {"throughput_fps", rounded(r.throughput_fps)},
      {"latency_ms",
       {{"critical_path", rounded(r.critical_path_ms)},
        {"end_to_end",
         {{"p50", rounded(percentile(r.end_to_end_ms, 0.5))},
          {"p95", rounded(percentile(r.end_to_end_ms, 0.95))}}}}},
  };
  return json.dump(2) + "\n";
}

std::string to_text(const RunReport& r) {
  const auto line = [](const char* node, const RunReport::Stages& all) {
    std::string out = fmt::format("{:<10}", node);
    for (const auto& [stage, ms] : all)
      out += fmt::format(" {} {:.0f}", stage, percentile(ms, 0.5));
    return out + "  (ms, p50)\n";
  };
  std::string out = fmt::format(
      "{}: {} sensors, {} frames, {} triangles, {} vertices\n"
      "mesh       {:.1f} kB/frame, {:.1f} kB to join; texture {:.1f} kB/frame; chunks {} new, {} "
      "kept\n",
      r.scene, r.sensors, r.frames, r.triangles, r.vertices, r.mesh_bytes_per_frame / 1e3,
      static_cast<double>(r.refresh_bytes) / 1e3, r.texture_bytes_per_frame / 1e3, r.chunks_new,
      r.chunks_kept);
  out += line("sensor", r.sensor_stages_ms) + line("merge", r.merge_stages_ms);
  out += fmt::format(
      "latency    critical path {:.0f} ms in frames with news; as it ran {:.0f} ms p50 of all "
      "frames\nthroughput {:.1f} frames/s by the slowest node\n",
      r.critical_path_ms, percentile(r.end_to_end_ms, 0.5), r.throughput_fps);
  if (!r.pairs.empty()) {
    out += "fit        ";
    for (const node::InputResidual& pair : r.pairs)
      out +=
          fmt::format(" {}~{} {:.1f}→{:.1f}", pair.a, pair.b, pair.residual_mm, pair.corrected_mm);
    out += "  (mm RMS between inputs)\n";
  }
  for (const node::CameraColor& camera : r.colors)
    if (!camera.note.empty()) out += fmt::format("colour     {}: {}\n", camera.sensor, camera.note);
  for (const auto& [cause, n] : r.drops) out += fmt::format("dropped    {} × {}\n", n, cause);
  return out;
}

}  // namespace mr::runtime
