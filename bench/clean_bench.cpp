// What the clean-up of depth pictures does to a scene and what each part of it takes:
//   clean_bench SCENE.yaml [FRAMES] [FOLDER]
// prints for each step, in their order, the median processor time of a picture on one thread in ms
// and how many pixels of all it took out and filled in. Where the scene is a synthetic rig, whose
// truth is known, also how many of those taken out had been right (within 5 sigma), how many of
// those filled in are, and the RMS error of the right ones in sigmas. FOLDER gets a picture of
// every sensor's first frame: depth in grey, taken out red, filled in green.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>

#include "mr/core/parallel.h"
#include "mr/fusion/fill_dropouts.h"
#include "mr/fusion/mixed_pixels.h"
#include "mr/fusion/ray_grid.h"
#include "mr/fusion/smooth_depth.h"
#include "mr/fusion/speckle.h"
#include "mr/kit/image_io.h"
#include "mr/node/capture.h"
#include "mr/node/sources.h"

namespace {

using namespace mr;

constexpr std::array<const char*, 6> kSteps{"to grid", "mixed",  "fill",
                                            "speckle", "smooth", "to depth"};

struct Tally {
  std::vector<double> ms;
  long out = 0, good_out = 0, in = 0, good_in = 0;  ///< pixels taken out and filled in
  long good = 0, bad = 0;                           ///< left
  double squares = 0;                               ///< of the good ones' errors / sigma
};
using Tallies = std::array<Tally, kSteps.size()>;

double off_sigmas(float z, float truth, const Precision& precision) {
  return std::abs(z - truth) / precision.sigma_m(truth);
}

void compare(const ImageDepth& before, const ImageDepth& after, const ImageDepth* truth,
             const Precision& precision, Tally& tally) {
  for (std::size_t i = 0; i < before.data.size(); ++i) {
    const float a = before.data[i], b = after.data[i], t = truth ? truth->data[i] : 0;
    const auto good = [&](float z) { return t > 0 && off_sigmas(z, t, precision) <= 5; };
    if (a > 0 && b <= 0) ++tally.out, tally.good_out += good(a);
    if (a <= 0 && b > 0) ++tally.in, tally.good_in += good(b);
    if (b <= 0) continue;
    ++(good(b) ? tally.good : tally.bad);
    if (good(b)) tally.squares += std::pow(off_sigmas(b, t, precision), 2);
  }
}

void draw(const std::filesystem::path& file, const ImageDepth& before, const ImageDepth& after) {
  ImageRgb out(before.width, before.height);
  for (std::size_t i = 0; i < before.data.size(); ++i) {
    const float a = before.data[i], b = after.data[i];
    const auto grey =
        static_cast<std::uint8_t>(std::clamp(255 - 50 * std::max(a, b), 0.0f, 255.0f));
    std::array<std::uint8_t, 3> color{grey, grey, grey};
    if (a <= 0 && b <= 0) color = {0, 0, 40};
    if (a > 0 && b <= 0) color = {255, 40, 40};
    if (a <= 0 && b > 0) color = {40, 230, 40};
    std::copy(color.begin(), color.end(), out.data.begin() + 3 * static_cast<std::ptrdiff_t>(i));
  }
  if (!kit::write_png(file, out)) std::fprintf(stderr, "%s: not written\n", file.c_str());
}

/// Cleans one picture step by step as clean_depth does.
ImageDepth clean(const ImageDepth& depth, const ImageDepth* truth, const Camera& camera,
                 const Precision& precision, const CleanConfig& config, Tallies& tallies) {
  const fusion::RaySpacing rays(camera);
  fusion::RayGrid grid(0, 0, false);
  ImageDepth now = depth;
  const auto step = [&](std::size_t index, bool wanted, const auto& work) {
    if (!wanted) return;
    const std::clock_t start = std::clock();
    work();
    tallies[index].ms.push_back(1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    const ImageDepth after = to_depth(grid, rays, nullptr);
    compare(now, after, truth, precision, tallies[index]);
    now = after;
  };
  step(0, true, [&] { grid = to_grid(depth, rays); });
  step(1, config.mixed_pixels, [&] { grid = drop_mixed_pixels(grid, rays, precision); });
  step(2, config.fill_px > 0, [&] { grid = fill_dropouts(grid, rays, precision, config.fill_px); });
  step(3, config.speckle_px > 1, [&] { drop_speckle(grid, rays, precision, config.speckle_px); });
  step(4, config.smooth_depth, [&] { grid = smooth_depth(grid, rays, precision); });
  step(5, true, [&] { now = to_depth(grid, rays, nullptr); });
  return now;
}

void print(const Tallies& tallies, long pixels, bool truth) {
  for (std::size_t i = 0; i < kSteps.size(); ++i) {
    Tally t = tallies[i];
    if (t.ms.empty()) continue;
    std::nth_element(t.ms.begin(), t.ms.begin() + t.ms.size() / 2, t.ms.end());
    std::printf("%-9s %6.2f ms  out %7ld  in %7ld", kSteps[i], t.ms[t.ms.size() / 2], t.out, t.in);
    if (truth)
      std::printf("  (right: out %6ld, in %6ld)  left: right %ld, wrong %ld, error %.3f sigma",
                  t.good_out, t.good_in, t.good, t.bad,
                  std::sqrt(t.squares / static_cast<double>(std::max(t.good, 1l))));
    std::printf("\n");
  }
  std::printf("of %ld pixels\n", pixels);
}

int bench(const std::filesystem::path& file, int frames, const std::filesystem::path& folder) {
  const SceneResult loaded = load_scene(file);
  for (const SceneProblem& p : loaded.problems) std::fprintf(stderr, "%s\n", to_string(p).c_str());
  if (!loaded.problems.empty()) return 1;
  const bool rig = loaded.scene.rig.has_value();
  Scene noiseless = loaded.scene;
  if (rig) noiseless.rig->noise = false;
  const auto scene = node::prepare_scene(loaded.scene), exact = node::prepare_scene(noiseless);
  if (!scene || !exact) return 1;
  node::CaptureReader reader(*scene, {}), truth_reader(*exact, {});
  Tallies tallies;
  long pixels = 0;
  for (int i = 0; i < frames; ++i) {
    const auto captured = reader.next();
    const auto truth = rig ? truth_reader.next() : std::nullopt;
    if (!captured) break;
    for (std::size_t k = 0; k < captured->size(); ++k) {
      const Frame& frame = (*captured)[k];
      const SensorConfig& sensor = scene->sensor(frame.sensor);
      pixels += static_cast<long>(frame.depth.data.size());
      const ImageDepth out =
          clean(frame.depth, rig ? &(*truth)[k].depth : nullptr, undistorted(sensor.depth_camera),
                sensor.precision, scene->fusion.clean, tallies);
      if (!folder.empty() && i == 0) draw(folder / (sensor.id + ".png"), frame.depth, out);
    }
  }
  print(tallies, pixels, rig);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return std::fprintf(stderr, "clean_bench SCENE.yaml [FRAMES] [FOLDER]\n"), 2;
  int result = 1;
  Arena(1).run([&] {
    result =
        bench(argv[1], argc > 2 ? std::max(1, std::atoi(argv[2])) : 1, argc > 3 ? argv[3] : "");
  });
  return result;
}
