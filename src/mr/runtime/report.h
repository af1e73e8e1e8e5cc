#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "mr/node/calibration_check.h"
#include "mr/node/root_colors.h"
#include "mr/scene/scene.h"

namespace mr::runtime {

/// The JSON report that `meshreduce run --report` writes. Programs outside the repository read it:
/// its keys are stable.
struct RunReport {
  std::string scene;
  std::string preset;   ///< of preset_of()
  int frames = 0;       ///< merged frames that reached the client
  int last_frame = -1;  ///< number of the newest of them, from 0 at the sources
  double fps = 0;       ///< frames per second as it ran
  int sensors = 0, threads = 0;
  double peak_rss_mb = 0;
  std::uint64_t triangles = 0, vertices = 0;      ///< of the last frame
  double mesh_bytes_per_frame = 0;                ///< mean; all of a packet except textures
  std::uint64_t refresh_bytes = 0;                ///< mesh payload that a late joiner needs
  double texture_bytes_per_frame = 0;             ///< mean
  std::uint64_t chunks_new = 0, chunks_kept = 0;  ///< over all frames
  std::map<std::string, std::uint64_t> drops;     ///< by cause
  using Stages = std::map<std::string, std::vector<double>>;
  Stages sensor_stages_ms, merge_stages_ms;
  std::vector<node::InputResidual> pairs;  ///< residuals between the mergers' inputs, last measured
  std::vector<node::CameraColor> colors;   ///< of cameras that see what others see
  double misplaced_px = 0;                 ///< how far their pictures lie beside each other
  double critical_path_ms = 0;             ///< slowest node of each layer, each alone, summed; p50
  /// Frames per second of the slowest node, each node run alone: nodes work concurrently, so the
  /// slowest one limits the rate, not the critical path.
  double throughput_fps = 0;
  std::vector<double> end_to_end_ms;  ///< per frame, capture to decoded at the client, as it ran
};

/// The parameters of a scene that determine its load, as a JSON object: sensors, picture sizes,
/// voxels, people, …
std::string preset_of(const Scene& scene);

/// Peak resident memory of this process, MB.
double peak_rss_mb();

std::string to_json(const RunReport& report);

/// A few lines for people.
std::string to_text(const RunReport& report);

}  // namespace mr::runtime
