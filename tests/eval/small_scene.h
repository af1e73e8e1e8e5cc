#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/temp_dir.h"
#include "mr/eval/quality.h"
#include "mr/node/sources.h"

namespace mr::eval {

/// A small synthetic scene in a folder of its own, with four small viewpoints stored beside it.
struct SmallScene {
  test::TempDir folder;
  Scene scene;

  explicit SmallScene(const std::string& rig = "",
                      const std::string& more = "reuse: {chunks: false}\n") {
    const auto file = folder.write(
        "small.yaml",
        "scene: small\nup: [0, 0, 1]\nvoxel_m: 0.03\n"
        "rig: {type: synthetic, seed: 3, room: [4, 3.5, 2.6], sensors: 3, "
        "depth_mode: nfov_binned, color: [320, 180], loop: true" +
            std::string(rig.find("frames:") == std::string::npos ? ", frames: 4" : "") + rig +
            "}\n"
            "simplify: {ratio: 0.3}\n" +
            more);
    SceneResult loaded = load_scene(file);
    for (const SceneProblem& problem : loaded.problems) ADD_FAILURE() << to_string(problem);
    scene = *node::prepare_scene(loaded.scene);
    ViewPlan plan;
    for (const double turn : {0.0, 1.6, 3.1, 4.7}) {
      render::Viewpoint view;
      view.name = "view-" + std::to_string(plan.views.size());
      view.camera.width = 160, view.camera.height = 120;
      view.camera.fx = view.camera.fy = 104;
      view.camera.cx = 79.5, view.camera.cy = 59.5;
      const Vec3d eye{0.3 * std::cos(turn), 0.3 * std::sin(turn), 1.5};
      view.T_world_camera =
          look_at(eye, eye + Vec3d{std::cos(turn), std::sin(turn), -0.3}, {0, 0, 1});
      plan.views.push_back(view);
    }
    const Status written = write_viewpoints(viewpoints_file(scene), plan, viewpoints_key(scene));
    if (!written) ADD_FAILURE() << written.error().message;
  }

  QualityConfig config() const {
    QualityConfig config;
    config.moments = 1, config.burst = 2;
    config.rig_cache = config.eval_cache = folder.path() / "cache";
    return config;
  }
};

}  // namespace mr::eval
