#pragma once

namespace mr::synth {

/// The fixed preset that figures are quoted for; it is printed in every report. From its start
/// both people, the table and the shelf are in the picture.
inline constexpr const char* kDemoScene = R"(scene: demo
voxel_m: 0.015
rig: {people: 2, sensors: 4, depth_mode: nfov, color: [1280, 720], frames: 300, loop: true}
mergers:
  - {id: root, inputs: [cam-0, cam-1, cam-2, cam-3], deadline_ms: 300}
simplify: {ratio: 0.1}
atlas: {size: [2560, 1440]}
gateway: {start: {eye: [-2.1, -2.6, 1.85], look_at: [0.2, 0.4, 0.85]}}
)";

}  // namespace mr::synth
