#include "mr/eval/photos.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "mr/baseline/baseline.h"
#include "mr/baseline/single_views.h"
#include "mr/baseline/vertex_colors.h"
#include "mr/core/user_text.h"
#include "mr/eval/client_run.h"
#include "mr/eval/covered_ssim.h"
#include "mr/eval/draw_scene.h"
#include "mr/eval/reference_surface.h"
#include "mr/kit/image_io.h"
#include "mr/kit/srgb.h"
#include "mr/sensor/registration.h"

namespace mr::eval {
namespace {

constexpr std::uint8_t kClipped = 254;

/// What is no pipeline: surfaces of one capture, not coded.
constexpr std::string_view kReconstructions[] = {baseline::kVertexColors, baseline::kSingleViews,
                                                 baseline::kLevelledViews};

/// What a client shows of a scene after so many captures.
Result<DecodedScene> shown_by(const std::string& system, Scene scene, int captures,
                              const runtime::RunListener& listener,
                              const std::filesystem::path& rig_cache) {
  if (std::ranges::find(kReconstructions, system) != std::end(kReconstructions)) {
    const auto capture = read_capture(scene, captures - 1, rig_cache, listener.dropped);
    if (!capture) return capture.error();
    if (system == baseline::kVertexColors) return baseline::vertex_colored_scene(scene, *capture);
    return baseline::single_view_scene(scene, *capture, system == baseline::kLevelledViews);
  }
  scene.pipeline = system;
  auto run = run_client(scene, captures, 1, listener, rig_cache);
  if (!run) return run.error();
  return std::move(run->last.back().scene);
}

/// The sensor that took the photographs.
Result<SensorId> camera_sensor(const Scene& scene, const std::string& id) {
  const auto found =
      id.empty() ? scene.sensors.begin() : std::ranges::find(scene.sensors, id, &SensorConfig::id);
  if (found == scene.sensors.end())
    return Error{Error::Cause::invalid,
                 fmt::format("scene '{}' has no sensor {}", scene.id, in_quotes(id))};
  if (!found->color_camera)
    return Error{
        Error::Cause::invalid,
        fmt::format("sensor '{}' has no colour camera: name one with --camera", found->id)};
  return sensor_at(static_cast<std::size_t>(found - scene.sensors.begin()));
}

/// A photograph without lens distortion.
struct Photograph {
  ImageRgb picture;
  render::Viewpoint from;
  Rect inside;  ///< the part that the picture as taken covers
};

Result<Photograph> read_photograph(const PhotoFile& file,
                                   const sensor::Registration& registration) {
  auto picture = kit::read_color(file.file);
  if (!picture) return picture.error();
  Frame frame;
  frame.color = *std::move(picture);
  const View view = *registration.color_view(file.T_world_depth);
  return Photograph{registration.undistort(std::move(frame)).color,
                    {file.file.stem().string(), view.camera(), view.T_world_camera},
                    view.image_rect};
}

/// A system's stream, with a renderer that keeps it on the GPU.
struct Contender {
  DecodedScene scene;
  render::Renderer renderer;
  std::uint64_t covered = 0;  ///< pixels of all photographs so far
};

Result<std::vector<Contender>> run_systems(const Scene& scene, const PhotoConfig& config,
                                           const runtime::RunListener& listener) {
  std::vector<Contender> out;
  for (const std::string& system : config.systems) {
    auto shown = shown_by(system, scene, config.captures, listener, config.rig_cache);
    if (!shown) return shown.error();
    auto renderer = render::Renderer::create();
    if (!renderer) return renderer.error();
    out.push_back({*std::move(shown), *std::move(renderer)});
  }
  return out;
}

/// Takes what lies outside a rectangle off a mask; the number of pixels left.
std::uint64_t keep_inside(ImageMask& mask, const Rect& rect) {
  std::uint64_t left = 0;
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x) {
      const bool in =
          x >= rect.x && y >= rect.y && x < rect.x + rect.width && y < rect.y + rect.height;
      if (!in) *mask.at(x, y) = 0;
      left += *mask.at(x, y);
    }
  return left;
}

/// Draws a photograph's view of every system; their masks hold only what the photograph covers.
Result<std::vector<RenderedView>> draw_all(std::vector<Contender>& contenders,
                                           const Photograph& photo) {
  std::vector<RenderedView> out;
  for (Contender& contender : contenders) {
    auto drawn = draw_scene(contender.renderer, contender.scene, photo.from);
    if (!drawn) return drawn.error();
    contender.covered += keep_inside(drawn->covered, photo.inside);
    out.push_back(*std::move(drawn));
  }
  return out;
}

ImageMask covered_by_all(const std::vector<RenderedView>& drawn) {
  ImageMask out = drawn.front().covered;
  for (const RenderedView& one : drawn)
    for (std::size_t i = 0; i < out.data.size(); ++i) out.data[i] &= one.covered.data[i];
  return out;
}

/// Brings the renders to the photograph's exposure and compares them.
Result<std::vector<std::optional<PhotoScore>>> compare(const Photograph& photo,
                                                       std::vector<RenderedView>& drawn) {
  const ImageMask covered = covered_by_all(drawn);
  const ImageLuma reference = luma_of(photo.picture);
  std::vector<std::optional<PhotoScore>> out;
  for (RenderedView& one : drawn) {
    const double gain = exposure_gain(one.color, photo.picture, covered);
    one.color = exposed(one.color, gain);
    const auto score = covered_ssim(luma_of(one.color), reference, covered);
    if (!score) return score.error();
    out.push_back(score->windows > 0 ? std::optional(PhotoScore{score->ssim, score->psnr_db, gain})
                                     : std::nullopt);
  }
  return out;
}

/// The photograph and, to its right, what each system shows.
Status write_pictures(const Photograph& photo, const std::vector<RenderedView>& drawn,
                      const std::filesystem::path& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) return Error{Error::Cause::io, "cannot make folder " + folder.string()};
  const ImageRgb& left = photo.picture;
  ImageRgb all(left.width * static_cast<int>(1 + drawn.size()), left.height);
  for (int y = 0; y < all.height; ++y) {
    std::copy_n(left.row(y), 3 * left.width, all.row(y));
    for (std::size_t i = 0; i < drawn.size(); ++i)
      std::copy_n(drawn[i].color.row(y), 3 * left.width,
                  all.at(left.width * static_cast<int>(1 + i), y));
  }
  return kit::write_png(folder / (photo.from.name + ".png"), all);
}

/// Fills in the means of a system's scores.
void summarize(PhotoSystem& system) {
  double ssim = 0, psnr_db = 0, count = 0;
  for (const auto& score : system.scores)
    if (score) ssim += score->ssim, psnr_db += score->psnr_db, ++count;
  system.ssim = ssim / count, system.psnr_db = psnr_db / count;
}

double to_millionth(double value) { return std::round(value * 1e6) / 1e6; }

nlohmann::ordered_json json_of(const PhotoSystem& system) {
  nlohmann::ordered_json by_picture = nlohmann::ordered_json::array();
  for (const auto& score : system.scores)
    by_picture.push_back(score ? nlohmann::ordered_json(to_millionth(score->ssim)) : nullptr);
  return {{"ssim", {{"mean", to_millionth(system.ssim)}}},
          {"psnr_db", to_millionth(system.psnr_db)},
          {"covered", to_millionth(system.covered)},
          {"ssim_by_picture", by_picture}};
}

}  // namespace

std::vector<std::string> photo_systems() {
  std::vector<std::string> out = baseline::pipeline_names();
  out.insert(out.end(), std::begin(kReconstructions), std::end(kReconstructions));
  return out;
}

double exposure_gain(const ImageRgb& rendered, const ImageRgb& photograph,
                     const ImageMask& covered) {
  struct Ratio {
    double gain, weight;
  };
  const auto luma = [](const std::uint8_t* rgb) {
    return 0.2126 * double{kit::to_linear(rgb[0])} + 0.7152 * double{kit::to_linear(rgb[1])} +
           0.0722 * double{kit::to_linear(rgb[2])};
  };
  const auto clips = [](const std::uint8_t* rgb) {
    return std::max({rgb[0], rgb[1], rgb[2]}) >= kClipped;
  };
  std::vector<Ratio> ratios;
  double all = 0;
  for (std::size_t i = 0; i < covered.data.size(); ++i) {
    const std::uint8_t *from = &rendered.data[3 * i], *to = &photograph.data[3 * i];
    if (!covered.data[i] || clips(from) || clips(to)) continue;
    const double light = luma(from);
    if (light > 0) ratios.push_back({luma(to) / light, light}), all += light;
  }
  // Least absolute deviations: the median of the ratios, weighted by the rendered light.
  std::ranges::sort(ratios, [](const Ratio& a, const Ratio& b) {
    return std::pair(a.gain, a.weight) < std::pair(b.gain, b.weight);
  });
  double below = 0;
  for (const Ratio& ratio : ratios)
    if ((below += ratio.weight) >= all / 2) return ratio.gain > 0 ? ratio.gain : 1;
  return 1;
}

ImageRgb exposed(const ImageRgb& picture, double gain) {
  std::array<std::uint8_t, 256> table{};
  for (int i = 0; i < 256; ++i)
    table[i] = kit::to_srgb(gain * double{kit::to_linear(static_cast<std::uint8_t>(i))});
  ImageRgb out = picture;
  for (std::uint8_t& v : out.data) v = table[v];
  return out;
}

Result<PhotoReport> compare_with_photographs(const Scene& scene, const PhotoConfig& config,
                                             const runtime::RunListener& listener) {
  const auto sensor = camera_sensor(scene, config.camera);
  if (!sensor) return sensor.error();
  auto files = find_photographs(config.photographs, *scene.sensor(*sensor).color_camera);
  if (!files) return files.error();
  if (const Status ok = check_not_delivered(*files, scene, config.captures, config.rig_cache); !ok)
    return ok.error();
  auto contenders = run_systems(scene, config, listener);
  if (!contenders) return contenders.error();
  PhotoReport report{scene.id, config.captures, *std::move(files), {}};
  for (const std::string& name : config.systems) report.systems.push_back({name, 0, 0, 0, {}});
  const sensor::Registration registration(scene.sensor(*sensor), *sensor);
  std::uint64_t pixels = 0, compared = 0;
  for (const PhotoFile& file : report.photographs) {
    const auto photo = read_photograph(file, registration);
    if (!photo) return photo.error();
    pixels += static_cast<std::uint64_t>(photo->inside.width) * photo->inside.height;
    auto drawn = draw_all(*contenders, *photo);
    if (!drawn) return drawn.error();
    const auto scores = compare(*photo, *drawn);
    if (!scores) return scores.error();
    compared += scores->front().has_value();
    for (std::size_t s = 0; s < scores->size(); ++s)
      report.systems[s].scores.push_back((*scores)[s]);
    if (!config.pictures.empty())
      if (const Status ok = write_pictures(*photo, *drawn, config.pictures); !ok) return ok.error();
  }
  if (compared == 0)
    return Error{Error::Cause::empty,
                 "no photograph shows what all systems cover: are the poses those of this scene?"};
  for (std::size_t s = 0; s < report.systems.size(); ++s) {
    summarize(report.systems[s]);
    report.systems[s].covered =
        static_cast<double>((*contenders)[s].covered) / static_cast<double>(pixels);
  }
  return report;
}

std::string to_json(const PhotoReport& report) {
  nlohmann::ordered_json out{{"scene", report.scene},
                             {"pipeline", report.systems.front().name},
                             {"captures", report.captures},
                             {"pictures", report.photographs.size()}};
  out.update(json_of(report.systems.front()));
  for (std::size_t s = 1; s < report.systems.size(); ++s)
    out["beside"][report.systems[s].name] = json_of(report.systems[s]);
  return out.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string to_text(const PhotoReport& report) {
  std::string out =
      fmt::format("{}, after {} capture{}, beside {} photographs\n", report.scene, report.captures,
                  report.captures == 1 ? "" : "s", report.photographs.size());
  for (const PhotoSystem& system : report.systems)
    out += fmt::format("  {:<16} SSIM {:.4f}, PSNR {:.2f} dB, covers {:.1f} %\n", system.name,
                       system.ssim, system.psnr_db, 100 * system.covered);
  for (std::size_t p = 0; p < report.photographs.size(); ++p) {
    out += fmt::format("  {}", report.photographs[p].file.filename().string());
    for (const PhotoSystem& system : report.systems)
      out += system.scores[p]
                 ? fmt::format("  {:.4f} / {:.2f} dB (gain {:.2f})", system.scores[p]->ssim,
                               system.scores[p]->psnr_db, system.scores[p]->gain)
                 : "  not covered";
    out += "\n";
  }
  return out;
}

}  // namespace mr::eval
