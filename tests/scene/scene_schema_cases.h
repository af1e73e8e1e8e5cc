#pragma once

/// What scene_schema_test.cpp goes through: scenes, and what a schema cannot say.
namespace mr::test {

/// What the reader checks and a schema cannot say: what its message holds, why, and how it ends.
struct BeyondSchema {
  const char *message, *why, *end = "";
};
inline constexpr BeyondSchema kBeyondSchema[] = {
    {"no such file", "files exist"},
    {"no folder ", "files exist"},
    {"is a folder, not a file", "files exist"},
    {"model: no file", "files exist"},
    {"of the pattern", "files exist"},
    {"must name a file, not ''", "the text after the environment is expanded"},
    {"times: ", "what the file holds"},
    {"sender: ", "the text is a numeric address"},
    {"of one of depth.txt", "what the files hold"},
    {"has at most", "two keys"},
    {"a frame's time", "another key gives it"},
    {"must be a multiple of 10", "arithmetic"},
    {"twice as wide as high", "two numbers of one list"},
    {"serial must have", "the text after the environment is expanded"},
    {"source names both serial and device", "two keys"},
    {"source needs serial", "two keys"},
    {"too many files", "two keys: first and last"},
    {"last must not be less than first", "two keys"},
    {"they must be as many", "two lists of one length"},
    {"color_camera is given but source names no color", "two keys of two mappings"},
    {"source names color but color_camera is missing", "two keys of two mappings"},
    {"poses for", "two lists of one length"},
    {"pose is not rigid", "geometry"},
    {"focal lengths do not fit the size", "geometry"},
    {"principal point", "geometry"},
    {"distortion folds", "geometry"},
    {"beam_altitude_deg must be a list of", "as many numbers as size says", "of them"},
    {"beam_azimuth_deg must be a list of", "as many numbers as size says", "of them"},
    {"must be [near, far]", "two numbers in order"},
    {"up must be a direction", "not all of three numbers 0"},
    {"look_at must be another place than eye", "two keys"},
    {"must be multiples of the lattice's step", "another key gives the step"},
    {", which is for pipeline points", "another key gives the range"},
    {"outside the lattice's cube", "pose, range and lattice together"},
    {"voxels of voxel_m", "another key gives the unit"},
    {"is empty: its first corner", "two corners in order"},
    {"region must lie on the chunk grid", "another key gives the grid"},
    {"the regions of mergers", "two mergers"},
    {"is used twice", "ids of the whole file"},
    {"is no sensor and no merger", "ids of the whole file"},
    {"is already an input of merger", "one tree"},
    {"reaches no root", "one tree"},
    {"more than one root", "one tree"},
    {"mergers form a cycle", "one tree"},
    {"is the merger's where 'mergers' is left out", "ids of the whole file"},
    {", after the rig's last, ", "two keys"},
    {", which is no sensor of the rig", "ids of the rig"},
    {"has a place outside the rig's room", "two keys"},
    {"cert and key only together", "two keys"},
    {"either nkey or credentials", "two keys"},
    {"needs tls:// in the url", "two keys"},
    {"more problems follow", "of those above"},
};

/// Every key of the schema stands in one of these scenes. They are valid.
inline constexpr const char* kImages = R"(
scene: s
up: [0, 0, 1]
fps: 25
threads: 2
voxel_m: 0.02
pipeline: meshreduce
lattice: {origin: [1, 0, 0], step_exp: -9}
video: {threads: 3, slices: 3}
volume: {box: [[-4, -4, -4], [4, 4, 4]], remove_floor: {height_m: 0.1, margin_m: 0.05}}
background: {model: m.glb, T_world_model: [1, 0, 0, 2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}
sensors:
  - id: a
    source: {type: rgbd-images, color: [c.png], depth: [d.png], depth_unit_m: 0.002, invalid: [0, 9], loop: true}
    depth_camera: {model: pinhole, size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240}
    color_camera: {size: [640, 480], fx: 500, fy: 500, cx: 320, cy: 240,
                   distortion: {model: rational, k: [0.01, 0, 0, 0, 0], p: [0.001, 0], most_radius: 1.7}}
    T_color_depth: [1, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    T_world_depth: {file: pose-0.txt}
    depth_range_m: [0.4, 4]
    precision: {base_m: 0.002, per_m2: 0.001}
    clock_offset_ms: 3
  - id: b
    source: {type: rgbd-images, depth: {pattern: "d%d.png", first: 0, last: 1}, invalid: 7}
    depth_camera: {size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240, distortion: {model: brown, k: [0.01]}}
    T_world_depth: {pattern: "pose-%d.txt", first: 0, last: 1}
mergers:
  - {id: w, inputs: [a, b], deadline_ms: 60, budget_ms: 20, region: [[-1.28, 0, 0], [0, 1.28, 1.28]]}
  - {id: e, inputs: [a, b], region: [[0, 0, 0], [1.28, 1.28, 1.28]]}
  - {id: r, inputs: [w, e]}
links: [{from: a, to: w, limit_mbps: 50}]
fusion: {decomposition: chunks, chunk_m: 1.28, patches: [2, 3], truncation_m: 0.07,
         mixed_pixels: false, speckle_px: 4, fill_px: 1, smooth_depth: false}
simplify: {ratio: 0.5, error_m: 0.002}
merge: {owner: paper, overlap: rays, refine: true, color_gain: true, simplify: {ratio: 0.5, error_m: 0.002},
        calibration_error_m: 0.01, island_area_m2: 0.1, gap_m: 0.1, agree_m: 0.03, fill_m: 0.1, leave_out_mm: 50}
atlas: {views: best_angle, mask: false, size: [512, 256], burn_sequence: true}
reuse: {chunks: false}
still: {layers: true, after_s: 3}
rate: {model: fixed, target_mbps: 10, rungs: 2, moving_weight: 0.7, model_file: models.json}
coding: {texture_scale: 0.5, texture_qp: 30, sensor_texture_qp: 20, depth_qp: 10, frame_divider: 1}
gateway: {listen: "0.0.0.0:80", start: {eye: [1, 1, 1.6], look_at: [0, 0, 1]}, tls: {cert: c.pem, key: k.pem},
          tokens: {file: tokens}, hosts: [room.example.org, "fe80::1"], open: true, viewers: 10, viewers_per_address: 2}
nats: {url: "tls://127.0.0.1:4222", ca: ca.pem, cert: node.pem, key: node.key,
       nkey: {public: UDXU4RCSJNZOIQHZNWXHXORDPRTGNJAHAHFRGZNEEJCPQTT2M7NLCNF4, seed: node.nk}}
tcp: {a: "127.0.0.1:9000", w: "[::1]:9001", secret: {env: TCP_SECRET}}
truth:
  mesh: "%06d.ply"
  rig: {seed: 7}
)";
inline constexpr const char* kRig = R"(
scene: s
rig: {type: synthetic, kind: corridor, seed: 2, room: [2, 12, 3], people: 1, sensors: 3, lidars: 1, depth_mode: wfov,
      lidar_beams: 64, lidar_noise_mm: 20, color: [640, 360], noise: none, calib_error_mm: 1, calib_error_deg: 1, exposure_spread: 1, clock_offset_ms: 1,
      detail: 0.25, frames: 100, loop: true, depth_noise: 2, depth_noise_px: 2, color_noise: 2, exposure_drift: 0.25,
      exposure_period_s: 30, events: [
        {kind: sit, at: 60, frames: 30, place: [0.5, -1]}, {kind: chair, at: 10, frames: 20, place: [0, 1], by_m: 0.7},
        {kind: door, at: 10, frames: 40}, {kind: carry, at: 50, place: [0, 2]},
        {kind: vanish, at: 40, frames: 30, place: [0, -2], sensor: cam-1}, {kind: light, at: 30, frames: 20, level: 0.1},
        {kind: screen, at: 0, frames: 50, place: [0, 3]}, {kind: push, at: 70, sensor: cam-2, by_mm: 20, by_deg: 1},
        {kind: dropout, at: 5, frames: 10, sensor: cam-1}, {kind: exposure, at: 1, frames: 2, sensor: cam-0, stops: -1},
        {kind: hunt, at: 2, frames: 3, sensor: cam-0, stops: 0.5, period_s: 0.5}]}
)";
inline constexpr const char* kLidar = R"(
scene: s
sensors:
  - id: a
    source: {type: rgbd-images, depth: d.png, color: c.png}
    depth_camera: {model: lidar, size: [1024, 2], beam_altitude_deg: [10, -10], beam_azimuth_deg: [1, -1]}
    color_camera: {model: equirectangular, size: [1024, 512]}
    T_world_depth: {files: [pose-0.txt]}
  - id: b
    source: {type: rgbd-images, depth: d.png}
    depth_camera: {model: lidar, size: [1024, 3], beam_altitude_deg: {from: 10, to: -10}}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
nats: {url: "nats://127.0.0.1:4222", credentials: node.creds}
tcp: {a: "127.0.0.1:9000", secret: {file: secret.txt}}
gateway: {tls: auto}
)";
inline constexpr const char* kRecordings = R"(
scene: s
sensors:
  - id: a
    source: {type: azure-kinect-mkv, file: kinect.mkv, calibration: calibration.json, loop: true}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    clock_drift_ppm: 20
    moving: true
  - id: b
    source: {type: ouster-pcap, file: turns.pcap, metadata: turns.json, texture: reflectivity, sender: 192.168.1.10, loop: true}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: c
    source: {type: ouster, metadata: turns.json, texture: none, sender: 192.168.1.11, address: 192.168.1.2, port: 7504}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: d
    source:
      type: lidar-360
      lidar: {type: ouster-pcap, file: turns.pcap, metadata: turns.json}
      color: {pictures: sphere.png, fps: 10, offset_ms: 5, yaw_deg: 90, stated_pose: false, loop: true}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: e
    source:
      type: lidar-360
      lidar: {type: rgbd-images, depth: d.png}
      color: {video: film.mp4}
    depth_camera: {model: lidar, size: [1024, 3], beam_altitude_deg: {from: 10, to: -10}}
    color_camera: {model: equirectangular, size: [64, 32]}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: f
    source: {type: tum, folder: desk, depth_unit_m: 0.0004, invalid: [0, 3], max_apart_ms: 30, loop: true}
    depth_camera: {size: [64, 48], fx: 50, fy: 50, cx: 32, cy: 24}
    color_camera: {size: [64, 48], fx: 50, fy: 50, cx: 32, cy: 24}
    T_world_depth: {trajectory: desk/groundtruth.txt, T_trajectory_depth: [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}
  - id: h
    source:
      type: lidar-360
      lidar: {type: ouster, metadata: turns.json}
      color:
        device: {path: /dev/video0, size: [2048, 1024], format: yuyv, fps: 15, exposure_us: 10000, gain: 10, white_balance_k: 4500}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: i
    source: {type: realsense-bag, file: realsense.bag, depth_unit_m: 0.002, loop: true}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: g
    source: {type: rgbd-images, depth: [d0.png, d1.png], times: times.txt}
    depth_camera: {size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
)";
inline constexpr const char* kDevices = R"(
scene: s
sensors:
  - id: a
    source: {type: k4a, serial: "000123456789", depth_mode: nfov_binned, color: 720p, fps: 15, sync: subordinate,
             subordinate_delay_us: 160, depth_delay_us: 80, exposure_us: 8330, gain: 100, white_balance_k: 4500,
             powerline_hz: 50, depth_unit_m: 0.00025}
    depth_camera: {size: [320, 288], fx: 252, fy: 252, cx: 160, cy: 144}
    color_camera: {size: [1280, 720], fx: 612, fy: 612, cx: 640, cy: 360}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
  - id: b
    source: {type: k4a, device: 1}
    depth_camera: {size: [640, 576], fx: 504, fy: 504, cx: 320, cy: 288}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
)";

}  // namespace mr::test
