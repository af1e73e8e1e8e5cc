// How long one comparison of two 960x720 pictures takes:
//   ssim_bench [THREADS] [RUNS]
// prints the median wall time and the mean processor time of Ssim::compare() with a mask, in ms.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <random>

#include "mr/core/parallel.h"
#include "mr/eval/ssim.h"

namespace {

using namespace mr;

eval::ImageLuma noise(unsigned seed) {
  eval::ImageLuma out(960, 720);
  std::mt19937 random(seed);
  for (float& v : out.data) v = static_cast<float>(random() % 256);
  return out;
}

int bench(int threads, int runs) {
  const eval::ImageLuma test = noise(2);
  ImageMask mask(960, 720);
  for (int y = 100; y < 600; ++y) std::fill(mask.at(100, y), mask.at(800, y), std::uint8_t{1});
  std::vector<double> wall_ms;
  double cpu_ms = 0, ssim = 0;
  Arena(threads).run([&] {
    const auto reference = eval::Ssim::prepare(noise(1));
    for (int i = 0; reference && i < runs; ++i) {
      const std::clock_t cpu = std::clock();
      const auto start = std::chrono::steady_clock::now();
      const auto score = reference->compare(test, mask);
      const std::chrono::duration<double, std::milli> took =
          std::chrono::steady_clock::now() - start;
      wall_ms.push_back(took.count());
      cpu_ms += 1e3 * static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
      ssim = score ? score->ssim_masked : -1;
    }
  });
  if (wall_ms.empty()) return 1;
  std::nth_element(wall_ms.begin(), wall_ms.begin() + runs / 2, wall_ms.end());
  std::printf(
      "ssim_bench: 960x720, %d threads, %d runs: median %.2f ms, processor %.2f ms (SSIM %.4f)\n",
      threads, runs, wall_ms[runs / 2], cpu_ms / runs, ssim);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return bench(argc > 1 ? std::atoi(argv[1]) : 2, argc > 2 ? std::max(1, std::atoi(argv[2])) : 50);
}
