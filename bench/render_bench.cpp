// Times the renderer on a room of about 50,000 triangles seen by four views, with a picture of
// 2560x1440 and an eye that walks around; milliseconds of wall clock and of processor, medians:
//   render_bench [RUNS [OUT_DIR]]        OUT_DIR: keeps what was drawn as PNG files
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "mr/kit/image_io.h"
#include "mr/kit/topology.h"
#include "mr/render/renderer.h"
#include "support/meshes.h"

namespace {

using namespace mr;

constexpr int kAtlasWidth = 2560, kAtlasHeight = 1440;
constexpr double kLength_m = 6, kWidth_m = 5, kHeight_m = 2.7;

ImageRgb atlas(int shift) {
  ImageRgb out(kAtlasWidth, kAtlasHeight);
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      const bool line = (x + shift) % 80 < 3 || y % 80 < 3;
      const auto wave = static_cast<std::uint8_t>(128 + 100 * std::sin(0.05 * x + 0.03 * y));
      auto* p = out.at(x, y);
      p[0] = line ? 20 : static_cast<std::uint8_t>(x / 10);
      p[1] = line ? 20 : static_cast<std::uint8_t>(y / 6);
      p[2] = line ? 20 : wave;
    }
  return out;
}

/// One view a quarter of the picture, from the upper corners of the room.
View corner_view(std::uint32_t corner) {
  View view;
  view.id = ViewId{corner};
  view.width = kAtlasWidth / 2, view.height = kAtlasHeight / 2;
  view.fx = view.fy = 560;
  view.cx = 0.5 * (view.width - 1), view.cy = 0.5 * (view.height - 1);
  view.image_rect = {0, 0, view.width, view.height};
  const int right = static_cast<int>(corner & 1), down = static_cast<int>(corner >> 1);
  view.atlas_rect = {right * view.width, down * view.height, view.width, view.height};
  const Vec3d eye{right ? kLength_m - 0.2 : 0.2, down ? kWidth_m - 0.2 : 0.2, 2.4};
  view.T_world_camera = look_at(eye, {kLength_m / 2, kWidth_m / 2, 1}, {0, 0, 1});
  return view;
}

/// Walls, floor, ceiling and a few balls, rough like a reconstruction.
Mesh room() {
  constexpr float kRough_m = 0.004f;
  const auto x = static_cast<float>(kLength_m), y = static_cast<float>(kWidth_m),
             z = static_cast<float>(kHeight_m);
  Mesh out = test::grid({0, 0, 0}, {x, 0, 0}, {0, y, 0}, 90, 75, kRough_m);
  append(out, test::grid({0, y, z}, {x, 0, 0}, {0, -y, 0}, 60, 50, kRough_m));
  append(out, test::grid({0, 0, z}, {x, 0, 0}, {0, 0, -z}, 90, 40, kRough_m));
  append(out, test::grid({0, y, 0}, {x, 0, 0}, {0, 0, z}, 90, 40, kRough_m));
  append(out, test::grid({0, 0, 0}, {0, y, 0}, {0, 0, z}, 75, 40, kRough_m));
  append(out, test::grid({x, 0, z}, {0, y, 0}, {0, 0, -z}, 75, 40, kRough_m));
  append(out, test::sphere({2, 2, 0.9f}, 0.5f, 32));
  append(out, test::sphere({4, 3.5f, 0.6f}, 0.4f, 32));
  return out;
}

/// The room in cubes of a metre, each triangle with the view that sees it best.
DecodedScene bench_scene() {
  DecodedScene scene;
  for (std::uint32_t corner = 0; corner < 4; ++corner) scene.views.push_back(corner_view(corner));
  const Mesh whole = room();
  std::map<Vec3i, std::pair<Mesh, std::vector<ViewId>>> cubes;
  for (std::size_t t = 0; t < whole.triangles.size(); ++t) {
    const Vec3d middle = vec_cast<double>(whole.centroid(t));
    const Vec3d normal = normalized(vec_cast<double>(whole.area_normal(t)));
    ViewId best = kNoView;
    double best_slant = 0;
    for (const View& view : scene.views) {
      const Vec3d from = view.T_world_camera.translation - middle;
      const auto at = project(view.camera(), view.T_world_camera.inverse() * middle);
      const double slant = dot(normal, normalized(from));
      if (!at || at->x < 4 || at->y < 4 || at->x > view.width - 5 || at->y > view.height - 5)
        continue;
      if (slant > best_slant) best = view.id, best_slant = slant;
    }
    auto& [mesh, views] =
        cubes[{static_cast<int>(middle.x), static_cast<int>(middle.y), static_cast<int>(middle.z)}];
    const auto base = static_cast<std::uint32_t>(mesh.positions.size());
    for (int i = 0; i < 3; ++i) mesh.positions.push_back(whole.corner(t, i));
    mesh.triangles.push_back({base, base + 1, base + 2});
    views.push_back(best);
  }
  for (auto& [cube, part] : cubes) {
    auto chunk = std::make_shared<Chunk>();
    set_triangle_views(part.first, part.second);
    chunk->mesh = kit::weld(part.first);
    scene.chunks.push_back(std::move(chunk));
  }
  return scene;
}

Camera eye_camera() {  // as the evaluation's viewpoints
  Camera c;
  c.width = 960, c.height = 720;
  c.fx = c.fy = 360 / std::tan(std::acos(-1.0) / 6);
  c.cx = 479.5, c.cy = 359.5;
  return c;
}

Camera panorama_camera() {
  Camera c;
  c.model = CameraModel::equirectangular;
  c.width = 1920, c.height = 960;
  return c;
}

Pose walk(int run) {
  const double turn = 0.7 * run;
  const Vec3d eye{3 + 1.5 * std::cos(turn), 2.5 + 1.2 * std::sin(turn), 1.5};
  return look_at(eye, {3 - 2 * std::cos(turn + 0.5), 2.5 - 2 * std::sin(turn + 0.5), 1.1},
                 {0, 0, 1});
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<long>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

struct Bench {
  render::Renderer renderer;
  int runs = 30;
  std::filesystem::path out_dir;

  /// `prepare` is called before each draw and not timed.
  bool time(const char* name, DecodedScene scene, const Camera& camera,
            const std::function<void(int, DecodedScene&)>& prepare) {
    std::vector<double> wall_ms, cpu_ms;
    for (int run = -3; run < runs; ++run) {  // three to get warm
      prepare(run + 3, scene);
      const auto start = std::chrono::steady_clock::now();
      const std::clock_t busy = std::clock();
      const auto image = renderer.draw(scene, camera, walk(run));
      const double busy_ms = 1e3 * static_cast<double>(std::clock() - busy) / CLOCKS_PER_SEC;
      const std::chrono::duration<double, std::milli> took =
          std::chrono::steady_clock::now() - start;
      if (!image) return std::fprintf(stderr, "%s\n", image.error().message.c_str()), false;
      if (run >= 0) wall_ms.push_back(took.count()), cpu_ms.push_back(busy_ms);
      if (run < 0 || run >= 4 || out_dir.empty()) continue;
      const auto file = out_dir / (std::string(name) + "_" + std::to_string(run) + ".png");
      if (auto ok = kit::write_png(file, *image); !ok) return false;
    }
    std::printf("%-22s %7.2f ms  %7.2f ms of processor\n", name, median(wall_ms), median(cpu_ms));
    return true;
  }
};

}  // namespace

int main(int argc, char** argv) {
  auto renderer = render::Renderer::create();
  if (!renderer) return std::fprintf(stderr, "%s\n", renderer.error().message.c_str()), 1;
  Bench bench{std::move(*renderer), argc > 1 ? std::atoi(argv[1]) : 30, argc > 2 ? argv[2] : ""};
  DecodedScene scene = bench_scene();
  std::size_t triangles = 0;
  for (const auto& chunk : scene.chunks) triangles += chunk->mesh.triangles.size();
  std::printf("%s; %zu triangles in %zu chunks\n", bench.renderer.device().c_str(), triangles,
              scene.chunks.size());

  const std::array pictures{std::make_shared<const ImageRgb>(atlas(0)),
                            std::make_shared<const ImageRgb>(atlas(40))};
  scene.textures[StreamId{0}] = pictures[0];
  const auto nothing = [](int, DecodedScene&) {};
  const auto new_picture = [&](int run, DecodedScene& s) {
    s.textures[StreamId{0}] = pictures[run & 1];
  };
  const auto new_chunks = [](int, DecodedScene& s) {
    for (auto& chunk : s.chunks) chunk = std::make_shared<const Chunk>(*chunk);
  };
  const bool ok = bench.time("draw", scene, eye_camera(), nothing) &&
                  bench.time("draw_new_picture", scene, eye_camera(), new_picture) &&
                  bench.time("draw_new_chunks", scene, eye_camera(), new_chunks) &&
                  bench.time("panorama", scene, panorama_camera(), nothing);
  return ok ? 0 : 1;
}
