#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mr/scene/scene.h"

namespace mr::apps {

/// Options of running a scene live.
struct LiveRun {
  std::vector<std::string> nodes;  ///< empty: the whole scene
  std::string listen;              ///< of the gateway; empty: as the scene says
  std::filesystem::path page;      ///< of the built viewer; empty: beside this program
  std::filesystem::path report;    ///< written at the end; empty: none
  std::string metrics;             ///< host:port of /metrics beside the gateway's; empty: none
  double seconds = 0;              ///< 0: until interrupted
  int threads = 0;
  bool open_browser = false;
};

/// Runs until interrupted, with one status line on a terminal; returns the exit code.
int run_live(Scene scene, const LiveRun& run);

}  // namespace mr::apps
