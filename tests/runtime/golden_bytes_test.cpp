#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "mr/core/file.h"
#include "mr/core/parallel.h"
#include "mr/core/simd.h"
#include "mr/model/export.h"
#include "mr/net/digest.h"
#include "mr/node/sources.h"
#include "mr/runtime/lockstep_scene.h"
#include "mr/scene/scene.h"
#include "mr/synth/demo_scene.h"
#include "mr/synth/room.h"
#include "support/shared_data.h"

/// The gate for changes that must not change results: SHA-256 of every packet of the root, and of
/// the exported mesh, against those stored in tests/data/bytes.
///   MR_FRAMES=40   the whole of what is stored, with the export after the last packet; else 3
///   MR_STORE=1     stores what comes out in place of comparing it
/// Stored bytes hold for pictures that are the stored ones (another processor may render others, by
/// a bit of a float) and for one version of x264; elsewhere a run is compared with nothing.
namespace mr {
namespace {

constexpr int kStoredFrames = 40, kFewFrames = 3;

std::string hex(const net::Sha256& digest) {
  std::string out;
  for (const unsigned char byte : digest)
    for (const int half : {byte >> 4, byte & 15}) out += "0123456789abcdef"[half];
  return out;
}

std::string digest_of(std::span<const std::byte> bytes) {
  return hex(net::sha256({reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
}

/// Of what the sensors see first.
std::string digest_of_inputs(const Scene& scene) {
  const std::vector<SensorId> all = all_sensors(scene.sensors);
  std::string bytes;
  for (const auto& source : node::open_sources(scene, all, synth::default_rig_cache())) {
    const auto frame = source->next();
    if (!frame || !*frame) continue;
    const ImageDepth& depth = (*frame)->depth;
    const ImageRgb& color = (*frame)->color;
    bytes.append(reinterpret_cast<const char*>(depth.data.data()),
                 depth.data.size() * sizeof(depth.data[0]));
    bytes.append(reinterpret_cast<const char*>(color.data.data()), color.data.size());
  }
  return hex(net::sha256(bytes));
}

/// A line each: "inputs DIGEST", "packet 0 DIGEST" …, "export DIGEST".
using Lines = std::vector<std::string>;

Lines run(const Scene& scene, int frames) {
  auto prepared = node::prepare_scene(scene);
  EXPECT_TRUE(prepared);
  Lines out{"inputs " + digest_of_inputs(*prepared) + " " + simd_target()};
  auto pipeline = runtime::LockstepScene::open(scene, synth::default_rig_cache());
  EXPECT_TRUE(pipeline) << pipeline.error().message;
  runtime::RunListener listener;
  listener.packet = [&](int frame, std::span<const std::byte> bytes) {
    out.push_back("packet " + std::to_string(frame) + " " + digest_of(bytes));
  };
  const auto report = (*pipeline)->run(frames, listener);
  EXPECT_TRUE(report) << report.error().message;
  if (frames < kStoredFrames) return out;
  const auto file =
      std::filesystem::temp_directory_path() / ("mr_bytes_" + std::to_string(::getpid()) + ".glb");
  EXPECT_TRUE(model::export_scene(*(*pipeline)->decoded(), scene.up, file));
  if (const auto bytes = read_file(file)) out.push_back("export " + digest_of(*bytes));
  std::filesystem::remove(file);
  return out;
}

Lines lines_of(const std::filesystem::path& file) {
  std::ifstream in(file);
  Lines out;
  for (std::string line; std::getline(in, line);) out.push_back(line);
  return out;
}

void compare(const std::string& name, const Scene& scene) {
  const auto file = std::filesystem::path(MR_SOURCE_DIR) / "tests/data/bytes" / (name + ".txt");
  const char* const frames = std::getenv("MR_FRAMES");
  Lines lines;
  Arena(2).run([&] { lines = run(scene, frames ? std::atoi(frames) : kFewFrames); });
  for (const std::string& line : lines) std::cout << name << ": " << line << "\n";
  if (std::getenv("MR_STORE")) {
    std::ofstream out(file);
    for (const std::string& line : lines) out << line << "\n";
    return;
  }
  const Lines stored = lines_of(file);
  ASSERT_FALSE(stored.empty()) << file;
  ASSERT_GT(lines.size(), 1u);
  if (lines[0] != stored[0]) GTEST_SKIP() << name << ": other pictures than the stored ones";
  for (std::size_t i = 1; i < std::min(lines.size(), stored.size()); ++i)
    ASSERT_EQ(lines[i], stored[i]) << name;
}

void compare_example(const std::string& name) {
  SceneResult loaded =
      load_scene(std::filesystem::path(MR_SOURCE_DIR) / "examples" / (name + ".yaml"));
  ASSERT_TRUE(loaded.problems.empty());
  compare(name, loaded.scene);
}

TEST(GoldenBytes, Demo) {
  const SceneResult demo = parse_scene(synth::kDemoScene, "demo");
  ASSERT_TRUE(demo.problems.empty());
  compare("demo", demo.scene);
}

TEST(GoldenBytes, TwoLayers) { compare_example("two-layers"); }

TEST(GoldenBytes, LidarRoom) { compare_example("lidar-room"); }

TEST(GoldenBytes, RedKitchen) {
  const auto folder = test::shared_data();
  if (!std::filesystem::exists(folder / "sevenscenes_redkitchen"))
    GTEST_SKIP() << "no recordings at " << folder << " (set MR_DATA)";
  ::setenv("MR_DATA", folder.c_str(), 1);
  compare_example("red-kitchen");
}

}  // namespace
}  // namespace mr
