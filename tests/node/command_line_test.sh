#!/usr/bin/env bash
# The commands as a user calls them: right exit codes, one clear line on what is wrong, no partial files.
#   command_line_test.sh PATH/TO/meshreduce
set -uo pipefail
meshreduce=$(realpath "$1")
here=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
export XDG_CACHE_HOME=$work/cache  # of rendered rigs
trap 'rm -rf "$work"' EXIT
cd "$work"
source "$here/tests/support/check.sh"

cat >room.yaml <<'YAML'
scene: room
up: [0, 0, 1]
voxel_m: 0.04
rig: {type: synthetic, seed: 1, sensors: 2, depth_mode: nfov_binned, color: [320, 180]}
fusion: {truncation_m: 0.16}
simplify: {ratio: 0.3}
YAML

check "demo --frames without --no-viewer" 107 "no-viewer" "$meshreduce" demo --frames 3
for command in run demo export info; do check "$command --help" 0 Example "$meshreduce" $command --help; done
check "no command" fails "subcommand" "$meshreduce"
check "unknown option" fails "nonsense" "$meshreduce" run room.yaml --nonsense
check "no such scene" fails "missing.yaml" "$meshreduce" run missing.yaml
check "info" 0 "2 sensors" "$meshreduce" info room.yaml
check "info as JSON" 0 '"sensors"' "$meshreduce" info room.yaml --json
check "run" 0 "triangles" "$meshreduce" run room.yaml --frames 2 --export out.glb --report out.json --snapshot pictures
for file in out.glb out.json pictures/above.png; do
  [ -s "$file" ] || fail_test "run: no $file"
done
check "Khronos validator" 0 "" node "$here/tests/tools/validate_gltf.mjs" out.glb
check "export PLY" 0 "triangles" "$meshreduce" export room.yaml out.ply
check "upper-case ending" 0 "triangles" "$meshreduce" export room.yaml OUT.PLY
mkdir folder.glb
check "export to a folder" fails "it is a folder" "$meshreduce" export room.yaml folder.glb
check "export OBJ" 0 "triangles" "$meshreduce" export room.yaml out.obj
check "unknown ending" fails "\.glb, \.ply or \.obj" "$meshreduce" export room.yaml out.stl
check "no such folder" fails "no folder" "$meshreduce" run room.yaml --export nowhere/out.glb

check "--set" 0 "2 sensors.*15 fps" "$meshreduce" info room.yaml --set fps=15
check "--set, an item and a map" 0 "waits 70 ms" "$meshreduce" info room.yaml --set 'mergers=[{id: r, inputs: [cam-0, cam-1]}]' \
  --set mergers.r.deadline_ms=70 --set gateway.listen=127.0.0.1:81
check "--set before the file" 0 "3 sensors" "$meshreduce" info --set rig.sensors=3 room.yaml
for option in fps=fast fpss=3 fps fps.x=1 mergers.0=1 'rig.sensors=[1'; do
  check "--set $option" fails "^--set '" "$meshreduce" run room.yaml --set "$option" --frames 1
  lines=$("$meshreduce" run room.yaml --set "$option" --frames 1 2>&1 | wc -l)
  [ "$lines" -eq 1 ] || fail_test "--set $option: $lines lines"
done
for command in "run room.yaml" "node room.yaml root" "export room.yaml o.ply" "info room.yaml" "plan room.yaml --mergers 1" demo \
  "eval ssim room.yaml" "eval geometry room.yaml" "eval views room.yaml" "eval compare room.yaml" "eval match room.yaml --mbps 5" \
  "eval rd room.yaml" "eval features room.yaml"; do
  check "$command --set" fails "^--set 'fps=-1': fps must be greater than 0" "$meshreduce" $command --set fps=-1
done
check "plan --set --write" fails "not change" "$meshreduce" plan room.yaml --mergers 1 --set fps=10 --write o.yaml
check "--set of a PLY" fails "are for scenes" "$meshreduce" eval geometry a.ply b.ply --set fps=10
check "what is not acted on" 0 "note: --set 'rate.target_mbps=5': rate.target_mbps: accepted, but not acted on" \
  "$meshreduce" info room.yaml --set rate.target_mbps=5

printf 'scene: bad\nvoxl_m: 1\nup: [0, 0, 0]\nsensors: []\n' >bad.yaml
check "unknown key, line 2" fails "bad.yaml:2:.*voxl_m" "$meshreduce" run bad.yaml
check "zero up, line 3" fails "bad.yaml:3:" "$meshreduce" run bad.yaml
cat >far.yaml <<'YAML'
scene: far
sensors:
  - id: a
    source: {type: rgbd-images, depth: ["d.png"]}
    depth_camera: {model: pinhole, size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240}
    T_world_depth: [1, 0, 0, 2500, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
YAML
check "a pose in millimetres, line 3" fails "far.yaml:3:.*metres" "$meshreduce" info far.yaml
mkdir empty
cat >empty.yaml <<'YAML'
scene: empty
sensors:
  - id: a
    source: {type: rgbd-images, color: {pattern: "empty/%06d.jpg", first: 0, last: 9}, depth: {pattern: "empty/%06d.png", first: 0, last: 9}}
    depth_camera: {model: pinhole, size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240}
    color_camera: {model: pinhole, size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
YAML
check "an empty folder" fails "empty.yaml:4:.*empty/000000" "$meshreduce" run empty.yaml

# A disk that is full: files over 32 kB cannot be written.
mkdir full
for ending in glb ply obj; do
  check "full disk, $ending" fails "full/out" \
    bash -c "trap '' XFSZ; ulimit -f 32; exec '$meshreduce' export room.yaml full/out.$ending"
  [ -z "$(ls -A full)" ] || { fail_test "full disk: left $(ls full)"; rm -rf full/*; }
done
finish
